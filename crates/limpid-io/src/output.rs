//! Files that are written whole or not at all, and their names.

mod stream;
mod target;

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, BufWriter, Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, SystemTime};

use image::codecs::jpeg::JpegEncoder;
use image::codecs::webp::WebPEncoder;
use image::{ImageEncoder as _, RgbImage};
use tempfile::NamedTempFile;

use crate::error::{Error, Result};
use crate::sequence::placeholder;

pub use stream::{Pipe, Stream, interrupt};
pub use target::{FileKind, Files, check_folder};

/// What the names of temporary files begin with.
const TEMPORARY: &str = ".limpid-";

/// Of 100: mean FLIP between a JPEG and its picture is 0.03 then, measured on the demo at 320×240.
const JPEG_QUALITY: u8 = 92;

/// A temporary file that has not been written to for so long is nobody's any more.
const ABANDONED: Duration = Duration::from_hours(24);

/// Files, and folders with all that is in them, that must not outlive the process.
static CLEANUP: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Writes a file under a temporary name beside `path`, then renames it. To a pipe or a device it is
/// written as it is.
///
/// # Errors
/// As [`FileKind::check`], and [`Error::Io`] naming `path`; then nothing is left under that name that was
/// not there before.
pub fn write_atomically(
    path: &Path,
    kind: FileKind,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> Result<()> {
    let fail = |e: io::Error| Error::io(path, "write", e);
    kind.check(path)?;
    if is_device(path) {
        return write_to_device(path, write).map_err(fail);
    }
    let temporary = Temporary::beside(path)?;
    let mut buffer = BufWriter::new(temporary.as_file());
    write(&mut buffer).map_err(fail)?;
    buffer.into_inner().map_err(|e| fail(e.into_error()))?;
    temporary.keep(path)
}

/// Whether a path leads to a pipe, a device or a socket: a file that took its name would be in
/// nobody's interest.
fn is_device(path: &Path) -> bool {
    path.metadata().is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}

/// By way of a file without a name: some formats are not written from their beginning to their end.
fn write_to_device(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> io::Result<()> {
    const PART: u64 = 1 << 20;
    let mut device = Pipe::open(path)?;
    let mut file = tempfile::tempfile()?;
    let mut buffer = BufWriter::new(&file);
    write(&mut buffer)?;
    buffer.into_inner().map_err(io::IntoInnerError::into_error)?;
    file.rewind()?;
    loop {
        let mut part = Vec::new();
        if (&file).take(PART).read_to_end(&mut part)? == 0 {
            return Ok(());
        }
        device.write(part)?;
    }
}

/// A file that is gone when it is dropped or the process is ended by [`abandon`], unless it is
/// given a name for good.
pub struct Temporary {
    // In this order: removed, then forgotten.
    file: NamedTempFile,
    cleanup: CleanupGuard,
}

impl Temporary {
    /// A file beside `path`.
    pub fn beside(path: &Path) -> Result<Self> {
        let mut builder = tempfile::Builder::new();
        // Temporary files are private by default; a picture is as readable as any other file.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        builder.prefix(TEMPORARY);
        let created = CleanupGuard::create(|| {
            let file = builder.tempfile_in(folder_of(&behind_link(path)))?;
            let name = file.path().to_owned();
            Ok((file, name))
        });
        let (file, cleanup) = created.map_err(|e| Error::io(path, "write", without_name(&e)))?;
        Ok(Self { file, cleanup })
    }

    /// To write to.
    pub fn as_file(&self) -> &File {
        self.file.as_file()
    }

    /// Its name until it is kept.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Renames it, now whole, to `path`.
    pub fn keep(self, path: &Path) -> Result<()> {
        let fail = |e: io::Error| Error::io(path, "write", e);
        self.file.as_file().sync_all().map_err(fail)?;
        self.file.persist(behind_link(path)).map_err(|e| fail(e.error))?;
        drop(self.cleanup);
        Ok(())
    }
}

/// An error that does not name the temporary file, which is nobody's concern.
fn without_name(error: &io::Error) -> io::Error {
    let source = error.get_ref().and_then(std::error::Error::source);
    let code = source.and_then(|e| e.downcast_ref::<io::Error>()?.raw_os_error());
    match code {
        // Some have no name but the system's: too many open files, for one.
        Some(code) if io::Error::from(error.kind()).to_string() == "uncategorized error" => {
            io::Error::from_raw_os_error(code)
        }
        _ => error.kind().into(),
    }
}

/// The file that a path leads to: a link stays one, and what it leads to is replaced.
fn behind_link(path: &Path) -> PathBuf {
    match path.is_symlink() {
        true => path.canonicalize().unwrap_or_else(|_| path.to_owned()),
        false => path.to_owned(),
    }
}

/// The folder that a file is in, or would be.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

/// The name of a file or a folder that [`abandon`] removes, until this is dropped.
#[derive(Debug)]
pub struct CleanupGuard(PathBuf);

impl CleanupGuard {
    /// Creates such a file or folder, of which `create` says the name.
    pub fn create<T>(create: impl FnOnce() -> io::Result<(T, PathBuf)>) -> io::Result<(T, Self)> {
        // Nobody ends the process between the file and its entry.
        let mut cleanup = cleanup();
        let (file, path) = create()?;
        cleanup.insert(path.clone());
        Ok((file, Self(path)))
    }
}

impl Drop for CleanupGuard {
    fn drop(&mut self) {
        cleanup().remove(&self.0);
    }
}

fn cleanup() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    locked(&CLEANUP)
}

/// Programs that write files for this one, which [`abandon`] ends first.
static CHILDREN: Mutex<Vec<Weak<Mutex<Child>>>> = Mutex::new(Vec::new());

/// Starts a program that writes a file, which [`abandon`] ends until it is dropped.
pub fn start(spawn: impl FnOnce() -> io::Result<Child>) -> io::Result<Arc<Mutex<Child>>> {
    // Nobody ends the process between the program and its entry.
    let mut children = locked(&CHILDREN);
    let child = Arc::new(Mutex::new(spawn()?));
    children.retain(|child| child.strong_count() > 0);
    children.push(Arc::downgrade(&child));
    Ok(child)
}

/// What a lock holds, whoever has panicked with it.
pub fn locked<T>(lock: &Mutex<T>) -> MutexGuard<'_, T> {
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files and folders and the claims of this process, for one that is about to end at
/// once: other threads wait for ever when they are about to create or to keep a file.
pub fn abandon() {
    // Else they would write again what is removed.
    let mut children = locked(&CHILDREN);
    for child in children.drain(..).filter_map(|child| child.upgrade()) {
        let mut child = locked(&child);
        let _ = child.kill();
        let _ = child.wait();
    }
    // Nor are others started.
    std::mem::forget(children);
    let cleanup = cleanup();
    for path in cleanup.iter() {
        // What cannot be removed now is swept up later.
        let _ = match path.is_dir() {
            true => std::fs::remove_dir_all(path),
            false => std::fs::remove_file(path),
        };
    }
    std::mem::forget(cleanup);
}

/// The time by the clock of the file system that `path` is on: clocks of machines differ, and ages of
/// files are told by the one that dates them.
pub fn file_time(path: &Path) -> Result<SystemTime> {
    let probe = Temporary::beside(path)?;
    let mut file = probe.as_file();
    let time = file.write_all(b"?").and_then(|()| file.sync_all());
    time.and_then(|()| file.metadata()?.modified()).map_err(|e| Error::io(path, "write", e))
}

/// Removes temporary files that killed processes have left in a folder: those to which nothing was
/// written for a day, by the clock of the file system.
pub fn sweep(folder: &Path) {
    let ours = |entry: &std::fs::DirEntry| {
        entry.file_name().to_str().is_some_and(|name| name.starts_with(TEMPORARY))
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let temporary: Vec<_> = entries.filter(ours).collect();
    if temporary.is_empty() {
        return;
    }
    // A folder that cannot be written to is an error when there is a picture to write.
    let Ok(now) = file_time(&folder.join("any")) else { return };
    for entry in temporary {
        let written = entry.metadata().and_then(|metadata| metadata.modified());
        let age = written.ok().and_then(|time| now.duration_since(time).ok());
        if age.is_some_and(|age| age > ABANDONED) {
            // Another may have been faster.
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// The formats of pictures, by the ending of their names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// `.png`: 8-bit sRGB, lossless.
    Png,
    /// `.jpg`, `.jpeg`: 8-bit sRGB, of quality 92.
    Jpeg,
    /// `.webp`: 8-bit sRGB, lossless.
    Webp,
    /// `.exr`: radiance before exposure and tone mapping, linear 32-bit floats.
    Exr,
}

impl PictureFormat {
    /// The format that a name says. A pipe or a device of another name gets PNG.
    ///
    /// # Errors
    /// [`Error::Usage`] naming those that can be written.
    pub fn of(path: &Path) -> Result<Self> {
        let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        match ending.as_str() {
            "png" => Ok(Self::Png),
            "jpg" | "jpeg" => Ok(Self::Jpeg),
            "webp" => Ok(Self::Webp),
            "exr" => Ok(Self::Exr),
            _ if is_device(path) => Ok(Self::Png),
            _ => Err(Error::Usage(format!(
                "{}: a picture ends in .png, .jpg, .webp or .exr",
                path.display()
            ))),
        }
    }

    /// Whether its files have room for notes: texts by name.
    pub fn holds_notes(self) -> bool {
        matches!(self, Self::Png | Self::Exr)
    }
}

/// Writes an 8-bit sRGB picture as PNG.
///
/// # Errors
/// As [`write_atomically`].
pub fn write_png(path: &Path, picture: &RgbImage) -> Result<()> {
    write_atomically(path, FileKind::Picture, |file| encode_png(file, picture, &[]))
}

/// Writes an 8-bit sRGB picture in the format that the name says; a PNG with these notes, each a
/// keyword and a text.
///
/// # Errors
/// As [`PictureFormat::of`], [`Error::Usage`] for `.exr`, which holds radiance
/// ([`crate::exr::write`]), and as [`write_atomically`].
pub fn write_picture(path: &Path, picture: &RgbImage, notes: &[(&str, String)]) -> Result<()> {
    let (width, height) = picture.dimensions();
    let rgb = image::ExtendedColorType::Rgb8;
    match PictureFormat::of(path)? {
        PictureFormat::Png => {
            write_atomically(path, FileKind::Picture, |file| encode_png(file, picture, notes))
        }
        PictureFormat::Jpeg => write_atomically(path, FileKind::Picture, |file| {
            let encoder = JpegEncoder::new_with_quality(file, JPEG_QUALITY);
            encoder.write_image(picture, width, height, rgb).map_err(io::Error::other)
        }),
        PictureFormat::Webp => write_atomically(path, FileKind::Picture, |file| {
            let encoder = WebPEncoder::new_lossless(file);
            encoder.write_image(picture, width, height, rgb).map_err(io::Error::other)
        }),
        PictureFormat::Exr => {
            let problem = "an .exr holds radiance, this is an 8-bit picture";
            Err(Error::Usage(format!("{}: {problem}; choose .png", path.display())))
        }
    }
}

/// Nothing but the picture and the notes goes into the file: no time, no machine.
fn encode_png(
    file: &mut BufWriter<&File>,
    picture: &RgbImage,
    notes: &[(&str, String)],
) -> io::Result<()> {
    let mut encoder = png::Encoder::new(file, picture.width(), picture.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Adaptive);
    for (keyword, text) in notes {
        encoder.add_text_chunk((*keyword).to_owned(), text.clone())?;
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(picture)?;
    Ok(writer.finish()?)
}

/// Where the pictures of a sequence go.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputNames {
    prefix: String,
    digits: usize,
    suffix: String,
    numbered: bool,
    // `-o` named a folder, not a file.
    folder: bool,
}

impl OutputNames {
    /// Parses `-o`: a file, a file with a place for the number (`{}`, `%04d`, `$F4`, `####`), or
    /// an existing folder or one written with a `/` at its end.
    ///
    /// # Errors
    /// [`Error::Usage`] if several frames would have one name.
    pub fn parse(output: &str, frames: usize) -> Result<Self> {
        if output.ends_with('/') || Path::new(output).is_dir() {
            let prefix = Path::new(output).join("frame_").to_string_lossy().into_owned();
            return Ok(Self {
                prefix,
                digits: 4,
                suffix: ".png".into(),
                numbered: true,
                folder: true,
            });
        }
        let plain = |text: &str| text.to_owned();
        let numbered = |(at, length, digits): (usize, usize, usize)| Self {
            prefix: plain(&output[..at]),
            digits: digits.min(20),
            suffix: plain(&output[at + length..]),
            numbered: true,
            folder: false,
        };
        let name = output.rfind('/').map_or(0, |slash| slash + 1);
        match placeholder(&output[name..]) {
            Some((at, length, digits)) => Ok(numbered((name + at, length, digits))),
            None if frames <= 1 => Ok(Self {
                prefix: plain(output),
                digits: 0,
                suffix: String::new(),
                numbered: false,
                folder: false,
            }),
            None => Err(Error::Usage(format!(
                "{frames} frames cannot all be {output}; put #### where the number goes, or name a folder"
            ))),
        }
    }

    /// Creates the folder that `-o FOLDER/` names, if it is not there.
    ///
    /// # Errors
    /// [`Error::Io`] naming the folder.
    pub fn create_folder(&self) -> Result<()> {
        match Path::new(&self.prefix).parent() {
            Some(folder) if self.folder => {
                std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))
            }
            _ => Ok(()),
        }
    }

    /// The frames whose files are there, in order.
    pub fn existing(&self) -> Vec<i64> {
        let of_name = |name: &str, folder: &Path| {
            let number = folder.join(name).to_str()?.to_owned();
            let number = number.strip_prefix(&self.prefix)?.strip_suffix(&self.suffix)?;
            let number: i64 = number.parse().ok()?;
            // `1` is not the file of frame 1 where that is `0001`.
            (self.path(number) == folder.join(name)).then_some(number)
        };
        let folder = Path::new(&self.prefix);
        let folder = if self.prefix.ends_with('/') { Some(folder) } else { folder.parent() };
        let folder = folder.unwrap_or(Path::new(""));
        let entries = std::fs::read_dir(folder_of(&folder.join("any")));
        let entries = entries.into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let mut frames: Vec<i64> = names.filter_map(|name| of_name(&name, folder)).collect();
        frames.sort_unstable();
        frames
    }

    /// The file for a frame.
    pub fn path(&self, frame: i64) -> PathBuf {
        let Self { prefix, digits, suffix, numbered, .. } = self;
        let sign = if frame < 0 { "-" } else { "" };
        match numbered {
            true => format!("{prefix}{sign}{:0digits$}{suffix}", frame.unsigned_abs()).into(),
            false => prefix.into(),
        }
    }
}
