//! Houdini's seekable compressed format, `.sc`: [Blosc](https://github.com/Blosc/c-blosc) chunks and an index.
//!
//! ```text
//! "scf1", 8 bytes, chunks, index, u64 length of the index (big-endian), "1fcs"
//! chunk: u8 version, u8 version of its compressor, u8 flags, u8 size of a number,
//!     u32 unpacked length, u32 length of a block, u32 length of the chunk (little-endian),
//!     u32 offset of each block in the chunk, blocks
//! block: one stream, or one for each byte of the numbers; a stream: u32 length, bytes
//! ```
//!
//! The layout of the container is that of public readers, since SideFX does not describe it; the chunks' is
//! Blosc's `README_CHUNK_FORMAT`. Blocks hold the first bytes of all numbers, then the second ones, and so on
//! (a *shuffle*), each packed by BloscLZ, LZ4 or zlib. Zstandard, Snappy and shuffles of bits are refused.

use std::io::Read as _;
use std::path::Path;

use flate2::read::ZlibDecoder;

use super::cursor::Cursor;
use crate::budget::Budget;
use crate::error::{Error, Location, Result};
use limpid::memory;

pub(super) fn is_container(bytes: &[u8]) -> bool {
    bytes.starts_with(b"scf1")
}

/// Unpacks the chunks, which take their bytes of the budget.
pub(super) fn unpack(path: &Path, bytes: &[u8], budget: &Budget) -> Result<Vec<u8>> {
    let damaged =
        |byte: usize, problem: &str| Error::malformed(path, Location::Byte(byte as u64), problem);
    const HEAD: usize = 12;
    let index = bytes.strip_suffix(b"1fcs").and_then(|rest| {
        let (rest, length) = rest.split_last_chunk()?;
        rest.len().checked_sub(usize::try_from(u64::from_be_bytes(*length)).ok()?)
    });
    let Some(end) = index.filter(|&end| end >= HEAD) else {
        return Err(damaged(
            bytes.len(),
            "the index at the end of the .sc file is missing: cut off",
        ));
    };
    let mut file = Cursor::new(path, &bytes[..end], false);
    file.take(HEAD, "the magic")?;
    let mut unpacked = Vec::new();
    while !file.rest().is_empty() {
        let start = file.offset;
        let head = file.array("a Blosc chunk")?;
        let chunk = Head::read(head).map_err(|problem| damaged(start, &problem))?;
        file.offset = start;
        let bytes = file.take(chunk.packed, "a Blosc chunk")?;
        budget.take(chunk.unpacked as u64, path, Location::Byte(unpacked.len() as u64))?;
        memory::grow(&mut unpacked, chunk.unpacked, path.display())?;
        let before = unpacked.len();
        chunk.unpack(bytes, &mut unpacked).map_err(|problem| damaged(start, &problem))?;
        if unpacked.len() - before != chunk.unpacked {
            return Err(damaged(start, "a Blosc chunk unpacks to another length than it says"));
        }
    }
    Ok(unpacked)
}

/// The header of a Blosc chunk.
struct Head {
    flags: u8,
    /// Size of a number, bytes.
    width: usize,
    unpacked: usize,
    block: usize,
    packed: usize,
}

/// Largest ratio of the compressors: a match of BloscLZ may have any length, 255 bytes for each of its own.
const MAX_RATIO: usize = 1032;

impl Head {
    fn read(bytes: [u8; 16]) -> std::result::Result<Self, String> {
        let [version, _, flags, width, sizes @ ..] = bytes;
        let [unpacked, block, packed] = [0, 4, 8].map(|at| {
            let size = sizes[at..].first_chunk().map_or(0, |&size| u32::from_le_bytes(size));
            size as usize
        });
        let kind = match flags >> 5 {
            2 => "Snappy",
            4 => "Zstandard",
            _ if flags & 4 != 0 => "a shuffle of bits",
            0 | 1 | 3 => "",
            _ => "an unknown compressor",
        };
        if !kind.is_empty() {
            return Err(format!("a Blosc chunk with {kind}, which limpid does not read"));
        }
        let possible = unpacked <= packed.saturating_mul(MAX_RATIO) && packed >= 16;
        if !(1..=2).contains(&version) || width == 0 || block == 0 || !possible {
            return Err("expected a Blosc chunk".into());
        }
        Ok(Self { flags, width: width.into(), unpacked, block, packed })
    }

    /// Appends the unpacked bytes.
    fn unpack(&self, chunk: &[u8], out: &mut Vec<u8>) -> std::result::Result<(), String> {
        const STORED: u8 = 2;
        const SHUFFLED: u8 = 1;
        let body = chunk.get(16..).unwrap_or_default();
        if self.flags & STORED != 0 {
            out.extend_from_slice(body);
            return Ok(());
        }
        let mut packed = Vec::new();
        for block in 0..self.unpacked.div_ceil(self.block) {
            let length = self.block.min(self.unpacked - block * self.block);
            let start = word(body, 4 * block).and_then(|start| chunk.get(start..));
            let mut rest = start.ok_or("a Blosc block begins beyond its chunk")?;
            let streams = self.streams(length);
            packed.clear();
            for _ in 0..streams {
                let size = word(rest, 0).ok_or("a Blosc stream is cut off")?;
                let stream = rest.get(4..).and_then(|rest| rest.split_at_checked(size));
                let (stream, after) = stream.ok_or("a Blosc stream is cut off")?;
                rest = after;
                self.stream(stream, length / streams, &mut packed)?;
            }
            if packed.len() != length {
                return Err("a Blosc block unpacks to another length than it says".into());
            }
            if self.flags & SHUFFLED != 0 && self.width > 1 {
                unshuffle(&packed, self.width, out);
            } else {
                out.extend_from_slice(&packed);
            }
        }
        Ok(())
    }

    /// Number of streams of a block of this length.
    fn streams(&self, length: usize) -> usize {
        const WHOLE: u8 = 16;
        const MOST: usize = 16;
        const SHORTEST: usize = 128;
        let divided = self.flags & WHOLE == 0
            && self.width <= MOST
            && length / self.width >= SHORTEST
            && length == self.block;
        if divided { self.width } else { 1 }
    }

    /// Appends the `length` bytes of a stream.
    fn stream(
        &self,
        stream: &[u8],
        length: usize,
        out: &mut Vec<u8>,
    ) -> std::result::Result<(), String> {
        if stream.len() == length {
            out.extend_from_slice(stream);
            return Ok(());
        }
        let start = out.len();
        match self.flags >> 5 {
            0 => blosclz(stream, start + length, out).ok_or("a BloscLZ stream is damaged")?,
            1 => {
                out.resize(start + length, 0);
                let unpacked = lz4_flex::block::decompress_into(stream, &mut out[start..]);
                unpacked.map_err(|error| format!("an LZ4 stream is damaged: {error}"))?;
            }
            _ => {
                let unpacked = ZlibDecoder::new(stream).take(length as u64).read_to_end(out);
                unpacked.map_err(|error| format!("a zlib stream is damaged: {error}"))?;
            }
        }
        if out.len() != start + length {
            return Err("a Blosc stream unpacks to another length than it says".into());
        }
        Ok(())
    }
}

fn word(bytes: &[u8], at: usize) -> Option<usize> {
    let word = bytes.get(at..)?.first_chunk()?;
    usize::try_from(u32::from_le_bytes(*word)).ok()
}

/// Appends the numbers of `width` bytes whose first bytes come first. Bytes that are left over follow as
/// they are.
fn unshuffle(bytes: &[u8], width: usize, out: &mut Vec<u8>) {
    let numbers = bytes.len() / width;
    let (shuffled, rest) = bytes.split_at(numbers * width);
    out.extend((0..shuffled.len()).map(|i| shuffled[i % width * numbers + i / width]));
    out.extend_from_slice(rest);
}

/// Unpacks a BloscLZ stream to the end of `out`, until `out` has `end` bytes at most; `None` if it is damaged.
///
/// Three bits of the first byte tell the length of a match, or 0 for literal bytes; the other five tell the
/// number of these, or begin the distance of the match.
fn blosclz(stream: &[u8], end: usize, out: &mut Vec<u8>) -> Option<()> {
    const FAR: usize = 8191;
    let start = out.len();
    // The first bytes are literal.
    let (mut code, mut rest) = stream.split_first().map(|(code, rest)| (code & 31, rest))?;
    loop {
        if code < 32 {
            let (literals, after) = rest.split_at_checked(usize::from(code) + 1)?;
            if out.len() + literals.len() > end {
                return None;
            }
            out.extend_from_slice(literals);
            rest = after;
        } else {
            let mut next = || rest.split_off_first().map(|&byte| usize::from(byte));
            let mut length = usize::from(code >> 5) + 2;
            if length == 9 {
                loop {
                    let more = next()?;
                    length += more;
                    if more != 255 {
                        break;
                    }
                }
            }
            let mut distance = (usize::from(code & 31) << 8) + next()?;
            if distance == FAR {
                distance += (next()? << 8) + next()?;
            }
            let from = out.len().checked_sub(distance + 1).filter(|&from| from >= start)?;
            if out.len() + length > end {
                return None;
            }
            // Byte by byte, since a match may go on into what it copies.
            (from..from + length).for_each(|at| out.push(out[at]));
        }
        match rest.split_off_first() {
            Some(&next) => code = next,
            None => return Some(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A container of one chunk with these flags, whose numbers have two bytes.
    fn container(flags: u8, unpacked: u32, body: &[u8]) -> Vec<u8> {
        let sizes = [unpacked, unpacked, 16 + body.len() as u32].map(u32::to_le_bytes);
        let head = [&[2, 1, flags, 2][..], sizes.as_flattened()].concat();
        [b"scf1\0\0\0\0\0\0\0\0", &head[..], body, &[0; 8], b"1fcs"].concat()
    }

    fn read(bytes: &[u8]) -> Result<Vec<u8>> {
        unpack(Path::new("a.bgeo.sc"), bytes, &Budget::new(Some(1000)))
    }

    /// BloscLZ: literal bytes, a match, and one that copies itself; LZ4; shuffled and stored bytes.
    #[test]
    fn chunks_have_their_documented_contents() {
        let block = |stream: &[u8]| {
            [&20_u32.to_le_bytes()[..], &(stream.len() as u32).to_le_bytes(), stream].concat()
        };
        let lz = [2, b'a', b'b', b'c', 1 << 5, 2, 0, b'x', 7 << 5, 3, 0];
        let words = b"abcabcxxxxxxxxxxxxx";
        assert_eq!(read(&container(0, 19, &block(&lz))).unwrap(), words);
        let lz4 = [0x12, b'a', 1, 0, 0x50, b'b', b'c', b'd', b'e', b'f'];
        assert_eq!(read(&container(1 << 5, 12, &block(&lz4))).unwrap(), b"aaaaaaabcdef");
        assert_eq!(read(&container(1, 5, &block(b"acbde"))).unwrap(), b"abcde");
        assert_eq!(read(&container(2, 3, b"abc")).unwrap(), b"abc");
    }

    /// Containers that are damaged, cut off, too large or of another kind are errors with a place.
    #[test]
    fn damaged_containers_are_errors() {
        let good = container(2, 3, b"abc");
        let far =
            [&20_u32.to_le_bytes()[..], &5_u32.to_le_bytes(), &[0, b'a', 1 << 5, 9, 0]].concat();
        for (bytes, part) in [
            (good[..good.len() - 1].to_vec(), "cut off"),
            (container(4 << 5, 3, b"abc"), "Zstandard"),
            (container(4, 3, b"abc"), "a shuffle of bits"),
            (container(2, 4, b"abc"), "another length"),
            (container(0, 9, &far), "a BloscLZ stream is damaged"),
            (container(0, 9, &[9; 8]), "beyond its chunk"),
            (container(2, 1 << 30, b"abc"), "expected a Blosc chunk"),
            (container(2, 1001, &[0; 1001]), "more than 1000 bytes"),
        ] {
            let error = read(&bytes).unwrap_err().to_string();
            assert!(error.starts_with("a.bgeo.sc: byte") && error.contains(part), "{error}");
        }
    }
}
