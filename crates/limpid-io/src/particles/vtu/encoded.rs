//! Encoded bytes of an array: base64 or raw, and blocks compressed by zlib, LZ4 or LZMA.

use std::borrow::Cow;
use std::io::Read as _;

use base64::prelude::{BASE64_STANDARD, Engine as _};
use flate2::{Decompress, FlushDecompress, Status};
use lzma_rust2::XzReader;
use rayon::prelude::*;

use crate::files::DEFLATE_RATIO;

/// A compression of arrays.
#[derive(Clone, Copy)]
pub(super) enum Compressor {
    Zlib,
    /// Blocks without a frame.
    Lz4,
    /// A stream of `.xz` for each block.
    Lzma,
}

impl Compressor {
    /// Largest size of data as a multiple of their compressed size.
    pub(super) fn ratio(self) -> u64 {
        match self {
            Self::Zlib => DEFLATE_RATIO,
            // A byte lengthens a match by 255.
            Self::Lz4 => 256,
            // A match of 273 bytes takes at least 14 decisions of 0.022 bits.
            Self::Lzma => 8192,
        }
    }

    fn unpack(self, packed: &[u8], block: &mut [u8]) -> Result<(), String> {
        let size = block.len();
        let complete = |unpacked: usize| match unpacked == size {
            true => Ok(()),
            false => Err(format!("does not unpack to {size} bytes")),
        };
        match self {
            Self::Zlib => {
                let mut zlib = Decompress::new(true);
                match zlib.decompress(packed, block, FlushDecompress::Finish) {
                    Ok(Status::StreamEnd) => complete(zlib.total_out() as usize),
                    Ok(_) => complete(0),
                    Err(error) => Err(format!("is damaged: {error}")),
                }
            }
            Self::Lz4 => match lz4_flex::block::decompress_into(packed, block) {
                Ok(unpacked) => complete(unpacked),
                Err(error) => Err(format!("is damaged: {error}")),
            },
            Self::Lzma => {
                /// Memory for the dictionary of the highest level, 64 MiB, and the decoder, KiB.
                const MEMORY: u32 = 66 << 10;
                let mut stream = XzReader::new_mem_limit(packed, false, MEMORY);
                // The checksum is compared at the end of the stream, after the last byte.
                let end = stream.read_exact(block).and_then(|()| stream.read(&mut [0]));
                match end {
                    Ok(more) => complete(size + more),
                    Err(error) => Err(format!("is damaged: {error}")),
                }
            }
        }
    }
}

/// Compressed blocks.
pub(super) struct Packed<'a> {
    pub(super) data: Cow<'a, [u8]>,
    /// Compressed size of each block, bytes.
    pub(super) sizes: Vec<u64>,
    /// Unpacked size of each block except the last, bytes.
    pub(super) block: usize,
    pub(super) compressor: Compressor,
}

impl Packed<'_> {
    pub(super) fn inflate(&self, unpacked: &mut [u8]) -> Result<(), String> {
        let mut rest = &*self.data;
        let split = |&size: &u64| rest.split_off(..size as usize).unwrap_or_default();
        let packed: Vec<&[u8]> = self.sizes.iter().map(split).collect();
        let blocks = unpacked.par_chunks_mut(self.block).zip(packed);
        blocks.enumerate().try_for_each(|(i, (block, packed))| {
            let unpacked = self.compressor.unpack(packed, block);
            unpacked.map_err(|problem| format!("block {i} {problem}"))
        })
    }
}

/// Encoded bytes of the file.
#[derive(Clone, Copy)]
pub(super) struct Encoded<'a> {
    pub(super) base64: bool,
    pub(super) bytes: &'a [u8],
}

impl<'a> Encoded<'a> {
    /// Decodes the first `length` bytes; returns also whether their base64 ends with them.
    pub(super) fn take(self, length: usize) -> Result<(Cow<'a, [u8]>, bool), String> {
        let available = self.bytes.len();
        let short = || format!("expected {length} bytes, but the file ends before them");
        if !self.base64 {
            let bytes = self.bytes.get(..length).ok_or_else(short)?;
            return Ok((Cow::Borrowed(bytes), false));
        }
        let encoded = Self::encoded_length(length).filter(|&encoded| encoded <= available);
        let encoded = &self.bytes[..encoded.ok_or_else(short)?];
        let mut bytes = BASE64_STANDARD.decode(encoded).map_err(|error| error.to_string())?;
        let separate = encoded.ends_with(b"=");
        if bytes.len() < length {
            return Err(format!(
                "expected {length} bytes, but the base64 ends after {}",
                bytes.len()
            ));
        }
        bytes.truncate(length);
        Ok((Cow::Owned(bytes), separate))
    }

    /// The rest after `length` bytes that were encoded separately.
    pub(super) fn after(self, length: usize) -> Self {
        let encoded = Self::encoded_length(length).unwrap_or(usize::MAX);
        let skipped = if self.base64 { encoded } else { length };
        Self { bytes: self.bytes.get(skipped..).unwrap_or_default(), ..self }
    }

    /// Length of the base64 of `length` bytes, characters.
    fn encoded_length(length: usize) -> Option<usize> {
        length.div_ceil(3).checked_mul(4)
    }
}
