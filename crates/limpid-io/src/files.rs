//! Reading of untrusted files: checks before they are opened, memory limits, and detection of changes
//! during reading.

use std::io::{self, BufRead, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use exr::meta::{BlockDescription, MetaData};
use image::{DynamicImage, ImageDecoder as _, ImageFormat, ImageReader, ImageResult};
use rayon::prelude::*;

use crate::budget::Budget;
use crate::error::{Error, Location, Result};
use limpid::memory;

#[cfg(any(test, target_arch = "wasm32"))]
pub mod given;
#[cfg(not(target_arch = "wasm32"))]
mod system;

#[cfg(target_arch = "wasm32")]
use given as system;

pub use crate::budget::unpacked_limit;
pub use system::{File, Metadata, is_file, metadata, names_in};

/// Largest size of scenes, camera paths and suites, bytes. They are written by hand.
const TEXT_LIMIT: u64 = 64 << 20;

/// Largest compression ratio of deflate.
pub const DEFLATE_RATIO: u64 = 1032;

/// Limits of what decoding a picture may allocate, whatever size it declares: as many 32-bit floats as
/// the formats can compress into its bytes, of which deflate compresses the most.
///
/// # Errors
/// The problem of a picture that would crash its decoder.
pub fn picture_limits(bytes: &[u8]) -> Result<image::Limits, String> {
    const PER_BYTE: u64 = 4 * DEFLATE_RATIO;
    const ALWAYS: u64 = 16 << 20;
    let packed = bytes.len() as u64;
    let most = packed.saturating_mul(PER_BYTE).clamp(ALWAYS, unpacked_limit(packed));
    match image::guess_format(bytes) {
        Ok(ImageFormat::Png) => check_palette(bytes)?,
        Ok(ImageFormat::OpenExr) => check_blocks(bytes, most)?,
        _ => {}
    }
    let mut limits = image::Limits::default();
    limits.max_alloc = Some(most);
    Ok(limits)
}

/// Decodes a picture within the file's memory limit and the available memory; the caller will need
/// `extra_per_pixel` further bytes for each pixel.
///
/// # Errors
/// [`Error::Format`] and [`limpid::Error::Memory`]. Errors of the decoder are in the inner result.
pub fn decode_picture<R: BufRead + Seek>(
    path: &Path,
    bytes: &[u8],
    reader: ImageReader<R>,
    extra_per_pixel: u64,
) -> Result<ImageResult<DynamicImage>> {
    decode_within(path, bytes, reader, extra_per_pixel, None)
}

/// As [`decode_picture`], for a picture of the document with this budget, of which nothing is taken.
pub(crate) fn decode_within<R: BufRead + Seek>(
    path: &Path,
    bytes: &[u8],
    mut reader: ImageReader<R>,
    extra_per_pixel: u64,
    budget: Option<&Budget>,
) -> Result<ImageResult<DynamicImage>> {
    let limits = picture_limits(bytes).map_err(|problem| Error::format(path, problem))?;
    reader.limits(limits.clone());
    let mut decoder = match reader.into_decoder() {
        Ok(decoder) => decoder,
        Err(error) => return Ok(Err(error)),
    };
    let (width, height) = decoder.dimensions();
    let pixels = u64::from(width) * u64::from(height);
    let decoded = decoder.total_bytes();
    let extra = extra_per_pixel.saturating_mul(pixels);
    let (needed, most) = (decoded.saturating_add(extra), unpacked_limit(bytes.len() as u64));
    let mut left = limits;
    if let Err(error) = left.reserve(decoded).and_then(|()| decoder.set_limits(left)) {
        return Ok(Err(error));
    }
    if needed > most {
        let problem = format!(
            "{width}x{height} pixels take {} MiB of memory, a file of {} KiB at most {}; it seems made \
             to exhaust memory",
            needed >> 20,
            bytes.len().div_ceil(1 << 10),
            most >> 20
        );
        return Err(Error::format(path, problem));
    }
    if let Some(budget) = budget.filter(|budget| needed > budget.left()) {
        return Err(budget.exceeded(path, Location::Byte(0)));
    }
    let name = path.display();
    memory::probe(usize::try_from(decoded).unwrap_or(usize::MAX), &name)?;
    let picture = DynamicImage::from_decoder(decoder);
    if picture.is_ok() {
        memory::probe(usize::try_from(extra).unwrap_or(usize::MAX), name)?;
    }
    Ok(picture)
}

/// Runs a third-party decoder and converts a panic into an error: with overflow checks, as in debug
/// builds, the `exr` crate (1.74) panics on damaged blocks.
///
/// # Errors
/// Those of `decode`, and [`Error::Format`].
pub fn catch_panics<T>(path: &Path, decode: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(decode))
        .unwrap_or_else(|_| Err(Error::format(path, "damaged: its decoder failed")))
}

/// As [`read`], for a picture. Of a large file in another format only the beginning is read.
pub fn read_picture(path: &Path, bytes: &mut Vec<u8>) -> Result<()> {
    const LARGE: u64 = 64 << 20;
    let (file, metadata) = open(path)?;
    if READS_PARTS && metadata.len() > LARGE {
        bytes.resize(64, 0);
        read_at(&file, bytes, 0).map_err(|source| Error::io(path, "read", source))?;
        if image::guess_format(bytes).is_err() {
            return Ok(());
        }
    }
    contents(path, &file, &metadata, unpacked_limit(metadata.len()), bytes)
}

/// Rejects palettes whose length is not a multiple of three, on which the `png` crate (0.18.1) panics.
fn check_palette(bytes: &[u8]) -> Result<(), String> {
    let mut rest = bytes.get(8..).unwrap_or_default();
    while let Some((&[a, b, c, d, ref name @ ..], after)) = rest.split_first_chunk::<8>() {
        let length = u32::from_be_bytes([a, b, c, d]) as usize;
        if name == b"PLTE" && !length.is_multiple_of(3) {
            return Err(format!("a palette of {length} bytes; expected three for each colour"));
        }
        // The chunk's contents and checksum.
        rest = after.get(length.saturating_add(4)..).unwrap_or_default();
    }
    Ok(())
}

/// Rejects blocks larger than `most` bytes: the `exr` crate (1.74) allocates any declared block size.
fn check_blocks(bytes: &[u8], most: u64) -> Result<(), String> {
    let meta = MetaData::read_from_buffered(bytes, false).map_err(|error| error.to_string())?;
    for header in &meta.headers {
        let pixels = match header.blocks {
            BlockDescription::Tiles(tiles) => tiles.tile_size.0.saturating_mul(tiles.tile_size.1),
            BlockDescription::ScanLines => {
                header.layer_size.0.saturating_mul(header.compression.scan_lines_per_block())
            }
        };
        let block = pixels.saturating_mul(header.channels.bytes_per_pixel);
        if block as u64 > most {
            return Err(format!("blocks of {block} bytes, more than can be in this file"));
        }
    }
    Ok(())
}

/// Opens a regular file. Pipes and devices are refused: opening a pipe blocks until it has a writer, and
/// a device may be endless.
pub fn open(path: &Path) -> Result<(File, Metadata)> {
    let fail = |source| Error::io(path, "read", source);
    let metadata = metadata(path).map_err(fail)?;
    if !metadata.is_file() {
        let kind = if metadata.is_dir() { "a folder" } else { "a pipe or device" };
        return Err(fail(io::Error::other(format!("this is {kind}, expected a file"))));
    }
    let file = File::open(path).map_err(fail)?;
    Ok((file, metadata))
}

/// Replaces `bytes` with the contents of a file, of at most the bytes that `limit` gives for its length.
/// Large files are read in parallel parts.
pub fn read(path: &Path, limit: impl Fn(u64) -> u64, bytes: &mut Vec<u8>) -> Result<()> {
    let (file, metadata) = open(path)?;
    contents(path, &file, &metadata, limit(metadata.len()), bytes)
}

/// As [`read`], for an open file.
pub fn contents(
    path: &Path,
    file: &File,
    metadata: &Metadata,
    limit: u64,
    bytes: &mut Vec<u8>,
) -> Result<()> {
    const PART: usize = 1 << 20;
    let fail = |source| Error::io(path, "read", source);
    if metadata.len() > limit {
        let length = metadata.len();
        let problem = format!("the file has {length} bytes, expected at most {limit}");
        return Err(Error::format(path, problem));
    }
    let length = usize::try_from(metadata.len());
    let length = length.map_err(|_| fail(io::ErrorKind::FileTooLarge.into()))?;
    let more = length.saturating_sub(bytes.len());
    if bytes.try_reserve_exact(more).is_err() {
        let what = path.display().to_string();
        return Err(limpid::Error::Memory { what, mib: metadata.len() >> 20 }.into());
    }
    bytes.resize(length, 0);
    // Exactly the initial length: a file that grows while it is read may have no end.
    let result = if !READS_PARTS || length < PART {
        read_whole(file, bytes)
    } else {
        let parts = bytes.par_chunks_mut(PART).enumerate();
        parts.map(|(i, part)| read_at(file, part, (i * PART) as u64)).collect()
    };
    // Checked first: a change is the usual cause of a short read, except in system file systems.
    unchanged(path, file, metadata)?;
    result.map_err(fail)
}

/// Fails if a file has changed since it was opened: half of an old frame and half of a new one may well
/// look valid.
pub fn unchanged(path: &Path, file: &File, before: &Metadata) -> Result<()> {
    let fail = |source| Error::io(path, "read", source);
    let after = file.metadata().map_err(fail)?;
    let same = after.len() == before.len() && after.modified().ok() == before.modified().ok();
    if same { Ok(()) } else { Err(fail(io::Error::other("it changed while it was read"))) }
}

/// Reads the text of a scene, a camera path or a suite.
pub fn read_text(path: &Path) -> Result<String> {
    let mut bytes = Vec::new();
    read(path, |_| TEXT_LIMIT, &mut bytes)?;
    String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        let lines = error.as_bytes()[..valid].iter().filter(|&&byte| byte == b'\n').count();
        Error::malformed(path, Location::Line(1 + lines as u64), "not text in UTF-8")
    })
}

/// Whether [`read_at`] is supported.
pub const READS_PARTS: bool = cfg!(any(unix, target_arch = "wasm32"));

#[cfg(not(target_arch = "wasm32"))]
fn read_whole(mut file: &File, bytes: &mut [u8]) -> io::Result<()> {
    io::Read::read_exact(&mut file, bytes)
}

#[cfg(target_arch = "wasm32")]
fn read_whole(file: &File, bytes: &mut [u8]) -> io::Result<()> {
    file.read_exact_at(bytes, 0)
}

#[cfg(unix)]
pub fn read_at(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, buffer, offset)
}

#[cfg(target_arch = "wasm32")]
pub fn read_at(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<()> {
    file.read_exact_at(buffer, offset)
}

#[cfg(not(any(unix, target_arch = "wasm32")))]
pub fn read_at(_: &File, _: &mut [u8], _: u64) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// A file shorter than its declared length is an error, as files of `/sys` are: the buffer may still
    /// contain the previous frame.
    #[test]
    #[cfg(target_os = "linux")]
    fn short_reads_are_errors() {
        let path = Path::new("/sys/kernel/mm/transparent_hugepage/enabled");
        let length = path.metadata().map_or(0, |metadata| metadata.len());
        if fs::read(path).is_ok_and(|contents| (contents.len() as u64) < length) {
            let error = read(path, |_| u64::MAX, &mut vec![7; 10]).unwrap_err();
            assert!(error.to_string().contains("cannot read"), "{error}");
        }
    }

    /// A file that grows, shrinks or is rewritten between its opening and the end of reading is an
    /// error, long or short. A file replaced by renaming, as limpid itself writes, is read as it was.
    #[test]
    fn changes_during_reading_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        type Change = fn(&Path);
        let grown: Change = |path| {
            let file = fs::OpenOptions::new().append(true).open(path).unwrap();
            file.set_len(5 << 20).unwrap();
        };
        let emptied: Change = |path| File::create(path).map(drop).unwrap();
        let replaced: Change = |path| {
            let other = path.with_extension("new");
            fs::write(&other, [1; 10]).unwrap();
            fs::rename(other, path).unwrap();
        };
        let written: Change = |path| fs::write(path, [1; 10]).unwrap();
        let changes = [(written, false), (grown, false), (emptied, false), (replaced, true)];
        for length in [1000, 3 << 20] {
            for (change, sound) in changes {
                fs::write(&path, vec![7; length]).unwrap();
                let (file, metadata) = open(&path).unwrap();
                change(&path);
                let mut bytes = Vec::new();
                let result = contents(&path, &file, &metadata, u64::MAX, &mut bytes);
                match result {
                    Ok(()) => assert!(sound && bytes == vec![7; length]),
                    Err(error) => {
                        let message = error.to_string();
                        assert!(
                            !sound && message.ends_with("it changed while it was read"),
                            "{message}"
                        );
                    }
                }
            }
        }
    }
}
