//! Reading files that may be anything: what is refused before it is opened, how much memory a file
//! may take, and what changes while it is read.

use std::fs::{File, Metadata};
use std::io::{self, BufRead, Read, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use exr::meta::{BlockDescription, MetaData};
use image::{DynamicImage, ImageDecoder as _, ImageFormat, ImageReader, ImageResult};
use rayon::prelude::*;

use crate::error::{Error, Location, Result};
use limpid::memory;

/// Scenes, paths and suites are written by hand; what is longer is none.
const TEXT_LIMIT: u64 = 64 << 20;

/// Deflate packs at most so many bytes into one.
pub const DEFLATE_RATIO: u64 = 1032;

/// The memory that a file of `packed` bytes may take, in bytes, where nobody says another: a hundred
/// times its length. Simulators' files hardly shrink to half when packed, so what is beyond is made
/// to be. A GiB is always fine, 16 never.
pub fn unpacked_limit(packed: u64) -> u64 {
    packed.saturating_mul(100).clamp(1 << 30, 16 << 30)
}

/// What decoding a picture may allocate, whatever size it claims: what its formats can pack into so
/// many bytes, of which deflate packs the most, as 32-bit floats.
///
/// # Errors
/// What is wrong with a picture that its decoder would not survive.
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

/// Decodes a picture, of each of whose pixels `each` bytes more will be made: no more in all than the
/// file may unpack to, and than there is.
///
/// # Errors
/// [`Error::Format`] and [`limpid::Error::Memory`]; what the decoder says is left to the caller.
pub fn decode_picture<R: BufRead + Seek>(
    path: &Path,
    bytes: &[u8],
    mut reader: ImageReader<R>,
    each: u64,
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
    let (made, most) =
        (decoded.saturating_add(each.saturating_mul(pixels)), unpacked_limit(bytes.len() as u64));
    let mut left = limits;
    if let Err(error) = left.reserve(decoded).and_then(|()| decoder.set_limits(left)) {
        return Ok(Err(error));
    }
    if made > most {
        let problem = format!(
            "{width}x{height} pixels take {} MiB of memory, a file of {} KiB at most {}; it seems made \
             to exhaust memory",
            made >> 20,
            bytes.len().div_ceil(1 << 10),
            most >> 20
        );
        return Err(Error::format(path, problem));
    }
    let name = path.display();
    memory::probe(usize::try_from(decoded).unwrap_or(usize::MAX), &name)?;
    let picture = DynamicImage::from_decoder(decoder);
    if picture.is_ok() {
        memory::probe(usize::try_from(each * pixels).unwrap_or(usize::MAX), name)?;
    }
    Ok(picture)
}

/// What a decoder that is not limpid's makes of a file. That it panics is an error too: where overflows
/// are looked for, as in development, the `exr` crate (1.74) does so over damaged blocks.
///
/// # Errors
/// Those of `decode`, and [`Error::Format`].
pub fn catch_panics<T>(path: &Path, decode: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(decode))
        .unwrap_or_else(|_| Err(Error::format(path, "damaged: its decoder cannot go on")))
}

/// As [`read`], of a picture; of a large file that is none only the beginning, which tells.
pub fn read_picture(path: &Path, bytes: &mut Vec<u8>) -> Result<()> {
    const LARGE: u64 = 64 << 20;
    let (file, metadata) = open(path)?;
    if cfg!(unix) && metadata.len() > LARGE {
        bytes.resize(64, 0);
        read_at(&file, bytes, 0).map_err(|source| Error::io(path, "read", source))?;
        if image::guess_format(bytes).is_err() {
            return Ok(());
        }
    }
    contents(path, &file, &metadata, unpacked_limit(metadata.len()), bytes)
}

/// The `png` crate (0.18.1) slices a palette in threes, and panics where that does not come out even.
fn check_palette(bytes: &[u8]) -> Result<(), String> {
    let mut rest = bytes.get(8..).unwrap_or_default();
    while let Some((&[a, b, c, d, ref name @ ..], after)) = rest.split_first_chunk::<8>() {
        let length = u32::from_be_bytes([a, b, c, d]) as usize;
        if name == b"PLTE" && !length.is_multiple_of(3) {
            return Err(format!("a palette of {length} bytes; three for each colour expected"));
        }
        // The contents and their checksum.
        rest = after.get(length.saturating_add(4)..).unwrap_or_default();
    }
    Ok(())
}

/// The `exr` crate (1.74) allocates a block as large as the header says, whatever is left.
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

/// Opens a regular file. Opening a pipe would wait for whoever writes to it, and a device may never
/// end; both are refused before.
pub fn open(path: &Path) -> Result<(File, Metadata)> {
    let fail = |source| Error::io(path, "read", source);
    let metadata = path.metadata().map_err(fail)?;
    if !metadata.is_file() {
        let kind = if metadata.is_dir() { "a folder" } else { "a pipe or device" };
        return Err(fail(io::Error::other(format!("this is {kind}, a file expected"))));
    }
    let file = File::open(path).map_err(fail)?;
    Ok((file, metadata))
}

/// Replaces `bytes` by the contents of a file of at most `limit` bytes of its length; of a large one
/// several parts are read at a time.
pub fn read(path: &Path, limit: impl Fn(u64) -> u64, bytes: &mut Vec<u8>) -> Result<()> {
    let (file, metadata) = open(path)?;
    contents(path, &file, &metadata, limit(metadata.len()), bytes)
}

/// As [`read`], of a file that is open.
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
        let problem = format!("the file has {length} bytes, at most {limit} expected");
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
    // Not to its end: a file that grows as fast as it is read has none.
    let result = if !cfg!(unix) || length < PART {
        let mut file = file;
        file.read_exact(bytes)
    } else {
        let parts = bytes.par_chunks_mut(PART).enumerate();
        parts.map(|(i, part)| read_at(file, part, (i * PART) as u64)).collect()
    };
    // That it changed is told first: it is why a file ends too early, but for those of the system.
    unchanged(path, file, metadata)?;
    result.map_err(fail)
}

/// Fails if a file is not as it was when it was opened: half of an old frame and half of a new one
/// may well pass for a frame.
pub fn unchanged(path: &Path, file: &File, before: &Metadata) -> Result<()> {
    let fail = |source| Error::io(path, "read", source);
    let after = file.metadata().map_err(fail)?;
    let same = after.len() == before.len() && after.modified().ok() == before.modified().ok();
    if same { Ok(()) } else { Err(fail(io::Error::other("it changed while it was read"))) }
}

/// The text of a scene, a path or a suite.
pub fn read_text(path: &Path) -> Result<String> {
    let mut bytes = Vec::new();
    read(path, |_| TEXT_LIMIT, &mut bytes)?;
    String::from_utf8(bytes).map_err(|error| {
        let valid = error.utf8_error().valid_up_to();
        let lines = error.as_bytes()[..valid].iter().filter(|&&byte| byte == b'\n').count();
        Error::malformed(path, Location::Line(1 + lines as u64), "not text in UTF-8")
    })
}

#[cfg(unix)]
pub fn read_at(file: &File, buffer: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, buffer, offset)
}

#[cfg(not(unix))]
pub fn read_at(_: &File, _: &mut [u8], _: u64) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Protects frames from the rest of the one before, whose memory they are read into: a file that is
    /// shorter than it says is an error. Those that the system makes up are.
    #[test]
    #[cfg(target_os = "linux")]
    fn what_ends_too_early_is_refused() {
        let path = Path::new("/sys/kernel/mm/transparent_hugepage/enabled");
        let length = path.metadata().map_or(0, |metadata| metadata.len());
        if fs::read(path).is_ok_and(|contents| (contents.len() as u64) < length) {
            let error = read(path, |_| u64::MAX, &mut vec![7; 10]).unwrap_err();
            assert!(error.to_string().contains("cannot read"), "{error}");
        }
    }

    /// Protects frames from being half of one and half of another: a file that grows, shrinks or is
    /// written again between its opening and the end of reading is refused, long or short. One that
    /// is replaced by renaming, as limpid itself writes, is read as it was.
    #[test]
    fn what_changes_while_it_is_read_is_refused() {
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
