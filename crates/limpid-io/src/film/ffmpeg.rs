//! Video by way of `ffmpeg`, a program of its own: pictures go to it through a pipe.

use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use glam::UVec2;

use super::Kind;
use crate::output;

/// Constant rate factors: the quality that x264 and libvpx keep up, whatever bits that takes.
/// Lower is better; these are a step above their defaults (23 and 32), so that fine caustics and
/// checkers stay clean.
const CRF_H264: &str = "18";
const CRF_VP9: &str = "24";

/// `ffmpeg`, which writes a file from pictures.
pub(super) struct Ffmpeg {
    child: Arc<Mutex<Child>>,
    pictures: Option<ChildStdin>,
    /// What it says; a file, so that it never waits for a reader.
    messages: File,
}

impl Ffmpeg {
    /// Starts the `ffmpeg` on `PATH`, for `frames / seconds` pictures of `size` per second.
    pub(super) fn start(
        kind: Kind,
        file: &Path,
        size: UVec2,
        (frames, seconds): (u16, u16),
    ) -> io::Result<Self> {
        let messages = tempfile::tempfile()?;
        let mut command = Command::new("ffmpeg");
        command.args(["-hide_banner", "-loglevel", "error", "-nostdin", "-y", "-xerror"]);
        command.args(["-f", "rawvideo", "-pixel_format", "rgb24"]);
        command.args(["-video_size", &format!("{}x{}", size.x, size.y)]);
        command.args(["-framerate", &format!("{frames}/{seconds}"), "-i", "pipe:0"]);
        // Colours are converted by the matrix that they are said to be in; without both, ffmpeg
        // converts by BT.601, and players guess by the size.
        let to_bt709 =
            "scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd+full_chroma_int";
        command.args(["-vf", &format!("{to_bt709},format=yuv420p")]);
        command.args(["-colorspace", "bt709", "-color_primaries", "bt709"]);
        command.args(["-color_trc", "bt709", "-color_range", "tv"]);
        match kind {
            Kind::Webm => {
                command.args(["-c:v", "libvpx-vp9", "-crf", CRF_VP9, "-b:v", "0"]);
                command.args(["-cpu-used", "2", "-row-mt", "1", "-f", "webm"]);
                // Without random names for the segment and its tracks, equal films are equal files.
                command.args(["-fflags", "+bitexact", "-flags:v", "+bitexact"]);
            }
            _ => {
                command.args(["-c:v", "libx264", "-crf", CRF_H264]);
                // The index first, so that playing begins before all is there.
                command.args(["-movflags", "+faststart", "-f", "mp4"]);
            }
        }
        // Said to be a file: what comes before a colon is else taken for a protocol.
        let mut name = OsString::from("file:");
        name.push(file);
        command.arg(name);
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(messages.try_clone()?);
        // In a group of its own, Ctrl-C is for limpid alone, which ends it too.
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
        let pictures = output::locked(&child).stdin.take();
        Ok(Self { child, pictures, messages })
    }

    /// Hands it a picture.
    pub(super) fn push(&mut self, picture: &[u8]) -> io::Result<()> {
        let Some(pictures) = &mut self.pictures else { return Err(self.problem()) };
        // It closes the pipe only when it gives up; what it says is why.
        pictures.write_all(picture).map_err(|_| self.problem())
    }

    /// Waits until all is written. It may end as if nothing were wrong where the disk was full for its
    /// last bytes; what it says tells.
    pub(super) fn finish(mut self) -> io::Result<()> {
        self.pictures = None;
        let good = self.wait()?.success() && self.messages.metadata()?.len() == 0;
        if good { Ok(()) } else { Err(self.problem()) }
    }

    /// Leaves it to others to end it meanwhile.
    fn wait(&self) -> io::Result<ExitStatus> {
        loop {
            if let Some(status) = output::locked(&self.child).try_wait()? {
                return Ok(status);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// Why it ended: its last lines.
    fn problem(&mut self) -> io::Error {
        self.pictures = None;
        let status = self.wait().map_or_else(|e| e.to_string(), |status| status.to_string());
        let mut text = Vec::new();
        let read = self.messages.rewind().and_then(|()| self.messages.read_to_end(&mut text));
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
    /// Ends it, if it has not ended; what it was writing is not wanted.
    fn drop(&mut self) {
        let mut child = output::locked(&self.child);
        // Both fail only for a process that is no more.
        let _ = child.kill();
        let _ = child.wait();
    }
}
