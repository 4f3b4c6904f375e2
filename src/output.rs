//! Files that are written whole or not at all, and their names.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Result};
use crate::sequence::placeholder;

/// Writes a file under a temporary name beside `path`, then renames it.
///
/// # Errors
/// [`Error::Io`] naming `path`; then nothing is left under that name that was not there before.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> Result<()> {
    let fail = |e: io::Error| Error::io(path, "write", e);
    // A pipe or a device is written to; a file that took its name would be in nobody's interest.
    if path.metadata().is_ok_and(|metadata| !metadata.is_file() && !metadata.is_dir()) {
        let file = File::options().write(true).open(path).map_err(fail)?;
        let mut buffer = BufWriter::new(&file);
        write(&mut buffer).map_err(fail)?;
        return buffer.flush().map_err(fail);
    }
    let temporary = temporary(path)?;
    let mut buffer = BufWriter::new(temporary.as_file());
    write(&mut buffer).map_err(fail)?;
    buffer.into_inner().map_err(|e| fail(e.into_error()))?;
    keep(temporary, path)
}

/// A file beside `path` that is gone when it is dropped, unless [`keep`] gives it that name.
pub(crate) fn temporary(path: &Path) -> Result<NamedTempFile> {
    let folder = match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    // Temporary files are private by default; a picture is as readable as any other file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let temporary = builder.prefix(".limpid-").tempfile_in(folder);
    // The error names the temporary file, which is nobody's concern.
    temporary.map_err(|e| Error::io(path, "write", e.kind().into()))
}

/// Renames a [`temporary`] file, now whole, to `path`.
pub(crate) fn keep(temporary: NamedTempFile, path: &Path) -> Result<()> {
    let fail = |e: io::Error| Error::io(path, "write", e);
    temporary.as_file().sync_all().map_err(fail)?;
    temporary.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}

/// Writes an 8-bit sRGB picture as PNG.
///
/// # Errors
/// As [`write_atomically`].
pub fn write_png(path: &Path, picture: &image::RgbImage) -> Result<()> {
    write_atomically(path, |file| {
        use image::ImageEncoder;
        image::codecs::png::PngEncoder::new(file)
            .write_image(picture, picture.width(), picture.height(), image::ExtendedColorType::Rgb8)
            .map_err(io::Error::other)
    })
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
