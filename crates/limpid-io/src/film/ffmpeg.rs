//! Video encoding by an `ffmpeg` process, which receives the pictures through a pipe.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use glam::UVec2;

use super::FilmFormat;
use crate::output;

/// Constant rate factors of x264 and libvpx, which hold the quality at any bit rate. Lower is better;
/// these are somewhat better than the defaults (23 and 32), to keep fine caustics and checkers clean.
const CRF_H264: &str = "18";
const CRF_VP9: &str = "24";

/// An `ffmpeg` process that encodes pictures into a file.
pub(super) struct Ffmpeg {
    child: Arc<Mutex<Child>>,
    stdin: Option<ChildStdin>,
    /// Its messages; a file, since a full pipe would block the process.
    stderr: File,
}

impl Ffmpeg {
    /// Starts the `ffmpeg` on `PATH` for pictures of `size` at `frames / seconds` per second.
    pub(super) fn start(
        kind: FilmFormat,
        file: &Path,
        size: UVec2,
        (frames, seconds): (u16, u16),
    ) -> io::Result<Self> {
        let stderr = tempfile::tempfile()?;
        let mut command = Command::new("ffmpeg");
        command.args(["-hide_banner", "-loglevel", "error", "-nostdin", "-y", "-xerror"]);
        command.args(["-f", "rawvideo", "-pixel_format", "rgb24"]);
        command.args(["-video_size", &format!("{}x{}", size.x, size.y)]);
        command.args(["-framerate", &format!("{frames}/{seconds}"), "-i", "pipe:0"]);
        // The conversion and the metadata must both name BT.709: by default ffmpeg converts by
        // BT.601, and players guess the matrix from the size.
        let to_bt709 =
            "scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd+full_chroma_int";
        command.args(["-vf", &format!("{to_bt709},format=yuv420p")]);
        command.args(["-colorspace", "bt709", "-color_primaries", "bt709"]);
        command.args(["-color_trc", "bt709", "-color_range", "tv"]);
        match kind {
            FilmFormat::Webm => {
                command.args(["-c:v", "libvpx-vp9", "-crf", CRF_VP9, "-b:v", "0"]);
                command.args(["-cpu-used", "2", "-row-mt", "1", "-f", "webm"]);
                // No random ids of the segment and its tracks, so that equal films are equal files.
                command.args(["-fflags", "+bitexact", "-flags:v", "+bitexact"]);
            }
            _ => {
                command.args(["-c:v", "libx264", "-crf", CRF_H264]);
                // The index at the beginning, so that playback can start during a download.
                command.args(["-movflags", "+faststart", "-f", "mp4"]);
            }
        }
        // Without `file:`, text before a colon would be taken for a protocol.
        let mut name = OsString::from("file:");
        name.push(file);
        command.arg(name);
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(stderr.try_clone()?);
        // In its own process group, so that Ctrl-C goes to limpid alone, which then ends ffmpeg.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let child = output::start(|| command.spawn()).map_err(|e| match e.kind() {
            io::ErrorKind::NotFound => io::Error::new(
                io::ErrorKind::NotFound,
                "this kind of film needs ffmpeg, which is not on PATH: install it (Debian: \
                 apt-get install ffmpeg), or write a .gif, an .apng, or pictures (film_####.png)",
            ),
            kind => io::Error::new(kind, format!("ffmpeg does not start: {e}")),
        })?;
        let stdin = output::locked(&child).stdin.take();
        Ok(Self { child, stdin, stderr })
    }

    /// Sends a picture.
    pub(super) fn push(&mut self, picture: &[u8]) -> io::Result<()> {
        let Some(stdin) = &mut self.stdin else { return Err(self.problem()) };
        // ffmpeg closes the pipe only on failure; its messages give the reason.
        stdin.write_all(picture).map_err(|_| self.problem())
    }

    /// Waits until the file is complete. Any message counts as a failure: if the disk is full for the
    /// last bytes, ffmpeg reports it but ends with success.
    pub(super) fn finish(mut self) -> io::Result<()> {
        self.stdin = None;
        let good = self.wait()?.success() && self.stderr.metadata()?.len() == 0;
        if good { Ok(()) } else { Err(self.problem()) }
    }

    /// Waits for the process by polling, so that [`output::abandon`] can lock and end it meanwhile.
    fn wait(&self) -> io::Result<ExitStatus> {
        loop {
            if let Some(status) = output::locked(&self.child).try_wait()? {
                return Ok(status);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// The reason of a failure: the last lines of the messages.
    fn problem(&mut self) -> io::Error {
        self.stdin = None;
        let status = self.wait().map_or_else(|e| e.to_string(), |status| status.to_string());
        let mut text = Vec::new();
        let read = self.stderr.rewind().and_then(|()| self.stderr.read_to_end(&mut text));
        let text = String::from_utf8_lossy(&text);
        let lines: Vec<&str> = text.lines().map(str::trim).filter(|l| !l.is_empty()).collect();
        let last = lines[lines.len().saturating_sub(3)..].join("; ");
        match read {
            Ok(_) if !last.is_empty() => {
                io::Error::other(format!("ffmpeg failed ({status}): {last}"))
            }
            _ => io::Error::other(format!("ffmpeg failed ({status}) without a word")),
        }
    }
}

impl Drop for Ffmpeg {
    /// Ends the process if it is running; its output is discarded.
    fn drop(&mut self) {
        let mut child = output::locked(&self.child);
        // Both fail only if the process has already ended.
        let _ = child.kill();
        let _ = child.wait();
    }
}
