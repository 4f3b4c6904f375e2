//! Atomic writing of output files, their formats and their names.

mod stream;
mod target;

use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, BufWriter, Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, SystemTime};

use etcetera::base_strategy::{BaseStrategy as _, choose_native_strategy};
use image::codecs::jpeg::JpegEncoder;
use image::codecs::webp::WebPEncoder;
use image::{DynamicImage, ImageEncoder as _, RgbImage};
use tempfile::NamedTempFile;

use crate::error::{Error, Result};
use crate::pattern::placeholder;

pub use crate::identity::folder_of;
pub use stream::{Pipe, Stream, interrupt};
pub use target::{FileKind, Files, check_folder};

/// Prefix of the names of temporary files.
const TEMPORARY: &str = ".limpid-";

/// Quality of JPEG, of 100. The mean FLIP error is then 0.03, measured on the demo at 320×240.
const JPEG_QUALITY: u8 = 92;

/// Age of its last write at which a temporary file counts as left by a killed process.
const STALE_AFTER: Duration = Duration::from_hours(24);

/// Files and folders to remove, with their contents, when the process ends.
static CLEANUP: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// The folder `limpid` in the user's cache folder, which may not exist yet: on Linux `$XDG_CACHE_HOME`
/// or `~/.cache`, on macOS `~/Library/Caches`, on Windows `%LOCALAPPDATA%`. `None` if there is no home.
pub fn cache_folder() -> Option<PathBuf> {
    Some(choose_native_strategy().ok()?.cache_dir().join("limpid"))
}

/// Writes a temporary file beside `path`, then renames it. Pipes and devices are written directly.
///
/// # Errors
/// As [`FileKind::check`], and [`Error::Io`] naming `path`; an existing file is then unchanged.
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

/// Whether a path leads to a pipe, a device or a socket, which must never be replaced by a file.
fn is_device(path: &Path) -> bool {
    path.metadata().is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir())
}

/// Writes to a device by way of an unnamed file, since some formats are not written sequentially.
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

/// A temporary file, removed when this is dropped or [`abandon`] ends the process, unless
/// [`Temporary::keep`] renames it.
pub struct Temporary {
    // Drop order: the file is removed, then the cleanup list forgets it.
    file: NamedTempFile,
    cleanup: CleanupGuard,
}

impl Temporary {
    /// Creates a file beside `path`.
    pub fn beside(path: &Path) -> Result<Self> {
        let mut builder = tempfile::Builder::new();
        // The permissions of ordinary files; those of temporary files are private by default.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        builder.prefix(TEMPORARY);
        let created = CleanupGuard::create(|| {
            let file = builder.tempfile_in(folder_of(&link_target(path)))?;
            let name = file.path().to_owned();
            Ok((file, name))
        });
        let (file, cleanup) = created.map_err(|e| Error::io(path, "write", without_path(&e)))?;
        Ok(Self { file, cleanup })
    }

    /// The file, to write to.
    pub fn as_file(&self) -> &File {
        self.file.as_file()
    }

    /// Its temporary path.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Renames the completed file to `path`.
    pub fn keep(self, path: &Path) -> Result<()> {
        let fail = |e: io::Error| Error::io(path, "write", e);
        self.file.as_file().sync_all().map_err(fail)?;
        self.file.persist(link_target(path)).map_err(|e| fail(e.error))?;
        drop(self.cleanup);
        Ok(())
    }
}

/// Strips the temporary file's path from an error.
fn without_path(error: &io::Error) -> io::Error {
    let source = error.get_ref().and_then(std::error::Error::source);
    let code = source.and_then(|e| e.downcast_ref::<io::Error>()?.raw_os_error());
    match code {
        // Some errors have only a system code: too many open files, for one.
        Some(code) if io::Error::from(error.kind()).to_string() == "uncategorized error" => {
            io::Error::from_raw_os_error(code)
        }
        _ => error.kind().into(),
    }
}

/// The file that a path leads to: the target of a link is replaced, not the link.
fn link_target(path: &Path) -> PathBuf {
    match path.is_symlink() {
        true => path.canonicalize().unwrap_or_else(|_| path.to_owned()),
        false => path.to_owned(),
    }
}

/// Keeps a file or a folder on the list that [`abandon`] removes, until this is dropped.
#[derive(Debug)]
pub struct CleanupGuard(PathBuf);

impl CleanupGuard {
    /// Creates a file or folder by `create`, which returns its path.
    pub fn create<T>(create: impl FnOnce() -> io::Result<(T, PathBuf)>) -> io::Result<(T, Self)> {
        // The lock prevents `abandon` between the creation and the entry.
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

/// Child processes that write files, which [`abandon`] ends first.
static CHILDREN: Mutex<Vec<Weak<Mutex<Child>>>> = Mutex::new(Vec::new());

/// Starts a child process that writes a file. [`abandon`] ends it as long as the handle exists.
pub fn start(spawn: impl FnOnce() -> io::Result<Child>) -> io::Result<Arc<Mutex<Child>>> {
    // The lock prevents `abandon` between the start and the entry.
    let mut children = locked(&CHILDREN);
    let child = Arc::new(Mutex::new(spawn()?));
    children.retain(|child| child.strong_count() > 0);
    children.push(Arc::downgrade(&child));
    Ok(child)
}

/// Locks a mutex, also a poisoned one.
pub fn locked<T>(lock: &Mutex<T>) -> MutexGuard<'_, T> {
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files, folders and claims of this process, immediately before it exits. Other
/// threads block forever as soon as they create or keep a file.
pub fn abandon() {
    // Otherwise they would rewrite the removed files.
    let mut children = locked(&CHILDREN);
    for child in children.drain(..).filter_map(|child| child.upgrade()) {
        let mut child = locked(&child);
        let _ = child.kill();
        let _ = child.wait();
    }
    // The lock stays held, so that no others start.
    std::mem::forget(children);
    let cleanup = cleanup();
    for path in cleanup.iter() {
        remove(path);
    }
    std::mem::forget(cleanup);
}

/// Removes a file or folder if it can; [`sweep`] removes the rest later.
fn remove(path: &Path) {
    /// A thread that is creating a file may add it to a folder that has just been emptied. It blocks at
    /// its next file, so that few attempts suffice.
    const ATTEMPTS: usize = 20;
    for _ in 0..ATTEMPTS {
        let removed = match path.is_dir() {
            true => std::fs::remove_dir_all(path),
            false => std::fs::remove_file(path),
        };
        if removed.is_ok() || !path.is_dir() {
            return;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Current time by the clock of the file system of `path`. Machines' clocks differ, and the ages of
/// files must be computed from the clock that dates them.
pub fn file_time(path: &Path) -> Result<SystemTime> {
    let probe = Temporary::beside(path)?;
    let mut file = probe.as_file();
    let time = file.write_all(b"?").and_then(|()| file.sync_all());
    time.and_then(|()| file.metadata()?.modified()).map_err(|e| Error::io(path, "write", e))
}

/// Removes temporary files that killed processes have left in a folder: those not written for a day, by
/// the clock of the file system.
pub fn sweep(folder: &Path) {
    let ours = |entry: &std::fs::DirEntry| {
        entry.file_name().to_str().is_some_and(|name| name.starts_with(TEMPORARY))
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let temporary: Vec<_> = entries.filter(ours).collect();
    if temporary.is_empty() {
        return;
    }
    // An unwritable folder is reported when a picture is written.
    let Ok(now) = file_time(&folder.join("any")) else { return };
    for entry in temporary {
        let written = entry.metadata().and_then(|metadata| metadata.modified());
        let age = written.ok().and_then(|time| now.duration_since(time).ok());
        if age.is_some_and(|age| age > STALE_AFTER) {
            // Another process may have removed it.
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// The picture formats, by file extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// `.png`: 8-bit sRGB, lossless.
    Png,
    /// `.jpg`, `.jpeg`: 8-bit sRGB, at quality 92.
    Jpeg,
    /// `.webp`: 8-bit sRGB, lossless.
    Webp,
    /// `.exr`: radiance before exposure and tone mapping, linear 32-bit floats.
    Exr,
}

impl PictureFormat {
    /// The format of a file's extension. Pipes and devices with another name get PNG.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the supported formats.
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

    /// Whether its files can hold notes: named texts.
    pub fn holds_notes(self) -> bool {
        matches!(self, Self::Png | Self::Exr)
    }
}

/// Writes an 8-bit sRGB picture as PNG.
///
/// # Errors
/// As [`write_atomically`].
pub fn write_png(path: &Path, picture: &RgbImage) -> Result<()> {
    let picture = DynamicImage::ImageRgb8(picture.clone());
    write_atomically(path, FileKind::PICTURE, |file| encode_png(file, &picture, &[]))
}

/// Writes an 8-bit sRGB picture, with or without coverage, in the format of the file's extension. A PNG gets
/// the notes, each a keyword and a text.
///
/// # Errors
/// As [`PictureFormat::of`], [`Error::Usage`] for `.exr`, which holds radiance
/// ([`crate::exr::write`]), and for a JPEG with coverage, and as [`write_atomically`].
pub fn write_picture(path: &Path, picture: &DynamicImage, notes: &[(&str, String)]) -> Result<()> {
    let format = byte_format(path, picture)?;
    write_atomically(path, FileKind::PICTURE, |file| encode(format, picture, notes, file))
}

/// Encodes a picture in the format of the extension of `path`, which messages name; see [`write_picture`].
///
/// # Errors
/// As [`write_picture`].
pub fn encode_picture(
    path: &Path,
    picture: &DynamicImage,
    notes: &[(&str, String)],
    to: impl io::Write,
) -> Result<()> {
    let format = byte_format(path, picture)?;
    encode(format, picture, notes, to).map_err(|e| Error::io(path, "write", e))
}

/// The format of the extension, which can hold this picture.
fn byte_format(path: &Path, picture: &DynamicImage) -> Result<PictureFormat> {
    let fail = |problem| Err(Error::Usage(format!("{}: {problem}", path.display())));
    match PictureFormat::of(path)? {
        PictureFormat::Jpeg if picture.color().has_alpha() => {
            fail("a .jpg holds no coverage; choose .png, .webp or .exr")
        }
        PictureFormat::Exr => fail("an .exr holds radiance, this is an 8-bit picture; choose .png"),
        format => Ok(format),
    }
}

fn encode(
    format: PictureFormat,
    picture: &DynamicImage,
    notes: &[(&str, String)],
    to: impl io::Write,
) -> io::Result<()> {
    let (width, height) = (picture.width(), picture.height());
    let (bytes, color) = (picture.as_bytes(), picture.color().into());
    let encoded = match format {
        PictureFormat::Jpeg => {
            let encoder = JpegEncoder::new_with_quality(to, JPEG_QUALITY);
            encoder.write_image(bytes, width, height, color)
        }
        PictureFormat::Webp => {
            WebPEncoder::new_lossless(to).write_image(bytes, width, height, color)
        }
        PictureFormat::Png | PictureFormat::Exr => return encode_png(to, picture, notes),
    };
    encoded.map_err(io::Error::other)
}

/// Encodes a picture with the notes, each a keyword and a text, and without time or machine, so that equal
/// pictures are equal files.
///
/// # Errors
/// Those of `file`.
pub fn encode_png(
    file: impl io::Write,
    picture: &DynamicImage,
    notes: &[(&str, String)],
) -> io::Result<()> {
    let mut encoder = png::Encoder::new(file, picture.width(), picture.height());
    let coverage = picture.color().has_alpha();
    encoder.set_color(if coverage { png::ColorType::Rgba } else { png::ColorType::Rgb });
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Adaptive);
    for (keyword, text) in notes {
        encoder.add_text_chunk((*keyword).to_owned(), text.clone())?;
    }
    let mut writer = encoder.write_header()?;
    writer.write_image_data(picture.as_bytes())?;
    Ok(writer.finish()?)
}

/// The output paths of a sequence's pictures.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutputNames {
    /// The only file, or the folder of the numbered ones.
    path: PathBuf,
    numbered: Option<NumberedName>,
    /// Whether `-o` names a folder.
    folder: bool,
}

/// A file name with a number.
#[derive(Debug, Clone, PartialEq, Eq)]
struct NumberedName {
    prefix: String,
    digits: usize,
    suffix: String,
}

impl OutputNames {
    /// Parses `-o`: a file, a file name with a placeholder for the number (`{}`, `%04d`, `$F4`, `####`),
    /// an existing folder, or a folder with a trailing `/`.
    ///
    /// # Errors
    /// [`Error::Usage`] if several frames would have the same name.
    pub fn parse(output: impl AsRef<Path>, frames: usize) -> Result<Self> {
        let output = output.as_ref();
        if output.as_os_str().as_encoded_bytes().ends_with(b"/") || output.is_dir() {
            let (prefix, suffix) = ("frame_".into(), ".png".into());
            let numbered = Some(NumberedName { prefix, digits: 4, suffix });
            return Ok(Self { path: output.to_owned(), numbered, folder: true });
        }
        let name = output.file_name().and_then(OsStr::to_str).unwrap_or_default();
        match placeholder(name) {
            Some((at, length, digits)) => {
                let (prefix, suffix) = (name[..at].into(), name[at + length..].into());
                let numbered = Some(NumberedName { prefix, digits: digits.min(20), suffix });
                let path = output.parent().unwrap_or(Path::new("")).to_owned();
                Ok(Self { path, numbered, folder: false })
            }
            None if frames <= 1 => {
                Ok(Self { path: output.to_owned(), numbered: None, folder: false })
            }
            None => Err(Error::Usage(format!(
                "{frames} frames cannot all be {}; put #### where the number goes, or end it \
                 with / for a folder",
                output.display()
            ))),
        }
    }

    /// Creates the folder of `-o FOLDER/` if it does not exist.
    ///
    /// # Errors
    /// [`Error::Io`] naming the folder.
    pub fn create_folder(&self) -> Result<()> {
        if self.folder {
            std::fs::create_dir_all(&self.path).map_err(|e| Error::io(&self.path, "create", e))?;
        }
        Ok(())
    }

    /// The frames whose files exist, ascending.
    pub fn existing(&self) -> Vec<i64> {
        let Some(NumberedName { prefix, suffix, .. }) = &self.numbered else { return Vec::new() };
        let number = |name: &str| {
            let number = name.strip_prefix(prefix)?.strip_suffix(suffix)?;
            let number: i64 = number.parse().ok()?;
            // The name must be the canonical one: `1` is not the file of frame 1 if that is `0001`.
            (self.path(number) == self.path.join(name)).then_some(number)
        };
        let entries = std::fs::read_dir(folder_of(&self.path.join("any")));
        let entries = entries.into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let mut frames: Vec<i64> = names.filter_map(|name| number(&name)).collect();
        frames.sort_unstable();
        frames
    }

    /// Path of a frame's file.
    pub fn path(&self, frame: i64) -> PathBuf {
        let Some(NumberedName { prefix, digits, suffix }) = &self.numbered else {
            return self.path.clone();
        };
        let sign = if frame < 0 { "-" } else { "" };
        self.path.join(format!("{prefix}{sign}{:0digits$}{suffix}", frame.unsigned_abs()))
    }
}
