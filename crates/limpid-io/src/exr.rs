//! `OpenEXR` files, for intermediate images and linear pictures.

use std::io;
use std::path::Path;

use exr::meta::header::Header;
use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, WritableImage};
use exr::prelude::{
    AttributeValue, ImageAttributes, IntegerBounds, LayerAttributes, MetaData, ReadChannels as _,
    ReadLayers as _,
};
use glam::UVec2;
use limpid::aov::{Channel, Part};

use crate::error::{Error, Location, Result};
use crate::files;
use crate::output::{FileKind, write_atomically};

/// Writes the parts to one `OpenEXR` file, atomically.
///
/// # Errors
/// [`Error::Io`] naming the file.
pub fn write(path: &Path, parts: Vec<Part>) -> Result<()> {
    let lossless = Encoding::FAST_LOSSLESS;
    write_atomically(path, FileKind::PICTURE, |file| encode(parts, lossless, None, file))
}

/// As [`write()`], with a text attribute in the header, for [`is_whole`].
///
/// # Errors
/// As [`write()`].
pub fn write_noted(path: &Path, parts: Vec<Part>, (name, text): (&str, String)) -> Result<()> {
    let lossless = Encoding::FAST_LOSSLESS;
    write_atomically(path, FileKind::PICTURE, |file| {
        encode(parts, lossless, Some((name, &text)), file)
    })
}

/// Whether the file exists, is complete, and has this text attribute in all headers.
pub fn is_whole(path: &Path, (name, text): (&str, &str)) -> bool {
    let matches = |header: &Header| {
        // The format does not mark which attributes all layers share.
        let attributes = [&header.shared_attributes.other, &header.own_attributes.other];
        attributes.iter().any(|attributes| match attributes.get(name.as_bytes()) {
            Some(AttributeValue::Text(found)) => found == text,
            _ => false,
        })
    };
    // The headers first, which is fast.
    let Ok((file, _)) = files::open(path) else { return false };
    let head = MetaData::read_from_unbuffered(file, false);
    head.is_ok_and(|head| head.headers.iter().all(matches)) && load(path).is_ok()
}

/// Encodes the parts, at least one, as one `OpenEXR` file.
fn encode(
    parts: Vec<Part>,
    encoding: Encoding,
    note: Option<(&str, &str)>,
    to: impl io::Write + io::Seek,
) -> io::Result<()> {
    let size = parts.first().map_or(UVec2::ONE, |part| part.size);
    let layers: Vec<_> = parts
        .into_iter()
        .map(|part| {
            let channels = part.channels.into_iter();
            let list = channels
                .map(|c| AnyChannel::new(c.name.as_str(), FlatSamples::F32(c.values)))
                .collect();
            Layer::new(
                (part.size.x as usize, part.size.y as usize),
                match part.name.as_str() {
                    "" => LayerAttributes::default(),
                    name => LayerAttributes::named(name),
                },
                encoding,
                AnyChannels::sort(list),
            )
        })
        .collect();
    let display_window = IntegerBounds::from_dimensions((size.x as usize, size.y as usize));
    let mut attributes = ImageAttributes::new(display_window);
    if let Some((name, text)) = note {
        attributes.other.insert(name.into(), AttributeValue::Text(text.into()));
    }
    let image = Image::from_layers(attributes, layers);
    image.write().to_buffered(to).map_err(io::Error::other)
}

/// Encodes the parts, at least one, as one `OpenEXR` file with the strongest lossless compression.
///
/// # Errors
/// Those of the encoder.
pub fn to_bytes(parts: Vec<Part>) -> io::Result<Vec<u8>> {
    let mut bytes = io::Cursor::new(Vec::new());
    encode(parts, Encoding::SMALL_LOSSLESS, None, &mut bytes)?;
    Ok(bytes.into_inner())
}

/// Reads the parts of an `OpenEXR` file, as written by [`write()`]. Channels are in the order of their
/// names; numbers of any width are converted to 32-bit floats.
///
/// # Errors
/// [`Error::Io`]; [`Error::Malformed`] for a damaged file; [`Error::Format`] for a file that is not
/// `OpenEXR`, has deep data, or declares more pixels than it can contain.
pub fn load(path: &Path) -> Result<Vec<Part>> {
    let mut bytes = Vec::new();
    files::read_picture(path, &mut bytes)?;
    parse(path, &bytes)
}

/// As [`load`], from the file's contents; `path` is for messages.
///
/// # Errors
/// As [`load`], without [`Error::Io`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Vec<Part>> {
    files::catch_panics(path, || decode(path, bytes))
}

fn decode(path: &Path, bytes: &[u8]) -> Result<Vec<Part>> {
    if !bytes.starts_with(&exr::meta::magic_number::BYTES) {
        return Err(Error::format(path, "not an OpenEXR file"));
    }
    let mut cursor = io::Cursor::new(bytes);
    let meta = MetaData::read_from_buffered(&mut cursor, false);
    let damaged = |cursor: &io::Cursor<&[u8]>, error: exr::error::Error| match error {
        exr::error::Error::NotSupported(problem) => Error::format(path, problem),
        error => Error::malformed(path, Location::Byte(cursor.position()), error.to_string()),
    };
    let meta = meta.map_err(|e| damaged(&cursor, e))?;
    let limits = files::picture_limits(bytes).map_err(|problem| Error::format(path, problem))?;
    let values = meta.headers.iter().map(|header| {
        let channels = header.channels.list.len() as u128;
        header.layer_size.0 as u128 * header.layer_size.1 as u128 * channels
    });
    let most = limits.max_alloc.map_or(u128::MAX, u128::from);
    if values.sum::<u128>() > most / size_of::<f32>() as u128 {
        return Err(Error::format(path, "claims more pixels than the file can hold"));
    }
    cursor.set_position(0);
    let read = exr::prelude::read().no_deep_data().largest_resolution_level();
    let read = read.all_channels().all_layers().all_attributes().from_buffered(&mut cursor);
    let image = read.map_err(|e| damaged(&cursor, e))?;
    let part = |layer: Layer<AnyChannels<FlatSamples>>| Part {
        name: layer.attributes.layer_name.map_or(String::new(), |name| name.to_string()),
        size: UVec2::new(layer.size.0 as u32, layer.size.1 as u32),
        channels: (layer.channel_data.list.into_iter())
            .map(|channel| Channel {
                name: channel.name.to_string(),
                values: channel.sample_data.values_as_f32().collect(),
            })
            .collect(),
    };
    Ok(image.layer_data.into_iter().map(part).collect())
}
