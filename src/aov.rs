//! Intermediate images as `OpenEXR` channels, to find the stage that is to blame.

use std::fmt;
use std::io;
use std::path::Path;
use std::str::FromStr;

use exr::meta::header::Header;
use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, WritableImage};
use exr::prelude::{
    AttributeValue, ImageAttributes, IntegerBounds, LayerAttributes, MetaData, ReadChannels as _,
    ReadLayers as _,
};
use glam::UVec2;
use serde::Deserialize;

use crate::error::{Error, Place, Result};
use crate::files;
use crate::fingerprint::Fingerprint;
use crate::gpu::{self, Gpu};
use crate::output::{Kind, write_atomically};
use crate::passes::Layers;
use crate::passes::caustics::CausticMap;
use crate::renderer::Images;

/// The attribute that holds a [`Fingerprint`].
const FINGERPRINT: &str = "limpid:fingerprint";

/// A kind of intermediate image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Aov {
    /// Depth of each layer as it was splatted, m; 0 where empty.
    Depth,
    /// Outward unit normal of each layer as it was splatted, view space; 0 where empty.
    Normal,
    /// Depth of each aggregate layer after smoothing.
    SmoothDepth,
    /// Normal of each aggregate layer after smoothing.
    SmoothNormal,
    /// Depth of the opaque scene, m.
    SolidDepth,
    /// Linear radiance of the picture.
    Radiance,
    /// Interfaces crossed per ray.
    Interfaces,
    /// Length inside the liquid per ray, m.
    Inside,
    /// Layer evaluations of the intersector per ray.
    Iterations,
    /// Failures of the intersector per ray.
    Failures,
    /// The caustic map of each light, in the light's own view: irradiance by light through liquid,
    /// W/m², and depth of the receivers, m.
    Caustics,
}

impl Aov {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Depth,
        Self::Normal,
        Self::SmoothDepth,
        Self::SmoothNormal,
        Self::SolidDepth,
        Self::Radiance,
        Self::Interfaces,
        Self::Inside,
        Self::Iterations,
        Self::Failures,
        Self::Caustics,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::SmoothDepth => "smooth_depth",
            Self::SmoothNormal => "smooth_normal",
            Self::SolidDepth => "solid_depth",
            Self::Radiance => "radiance",
            Self::Interfaces => "interfaces",
            Self::Inside => "inside",
            Self::Iterations => "iterations",
            Self::Failures => "failures",
            Self::Caustics => "caustics",
        }
    }
}

impl fmt::Display for Aov {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Aov {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|aov| aov.name() == text).ok_or_else(|| {
            let known: Vec<_> = Self::ALL.iter().map(Self::to_string).collect();
            Error::Usage(format!("no AOV `{text}`; there are all, {}", known.join(", ")))
        })
    }
}

/// Parses a list such as `depth,normal`, or `all`.
///
/// # Errors
/// [`Error::Usage`] naming the unknown entry.
pub fn parse_list(text: &str) -> Result<Vec<Aov>> {
    if text == "all" {
        return Ok(Aov::ALL.to_vec());
    }
    let mut chosen = Vec::new();
    for name in text.split(',') {
        let aov = name.trim().parse()?;
        if !chosen.contains(&aov) {
            chosen.push(aov);
        }
    }
    Ok(chosen)
}

/// One channel of 32-bit floats.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// `depth.aggregate_front`, `normal.splash_back.X`, `inside`, ….
    pub name: String,
    /// Rows from the top.
    pub values: Vec<f32>,
}

/// Channels of one size: a part of an `OpenEXR` file.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// `limpid` for those of the picture's size, `caustics.1` for the map of the first light; empty
    /// for a picture alone.
    pub name: String,
    /// Width and height, pixels.
    pub size: UVec2,
    /// The images.
    pub channels: Vec<Channel>,
}

/// Reads the chosen images of the last frame back from the device: first those of the picture's
/// size, then the lights' maps.
///
/// Images that the frame did not have (splash layers without splashes) have no channels.
///
/// # Errors
/// [`Error::DeviceLost`].
pub fn read(gpu: &Gpu, images: &Images, chosen: &[Aov]) -> Result<Vec<Part>> {
    let mut channels = Vec::new();
    let mut maps = Vec::new();
    let texels = |texture: &wgpu::Texture, layer: u32| -> Result<Vec<[f32; 4]>> {
        Ok(bytemuck::pod_collect_to_vec(&gpu::read_texture(gpu, texture, layer)?))
    };
    for &aov in chosen {
        match aov {
            Aov::Depth | Aov::Normal | Aov::SmoothDepth | Aov::SmoothNormal => {
                let smooth = matches!(aov, Aov::SmoothDepth | Aov::SmoothNormal);
                let aggregate = if smooth { &images.smoothed } else { &images.aggregate };
                let classes = [("aggregate", Some(aggregate)), ("splash", images.splash.as_ref())];
                for (class, layers) in classes {
                    let Some(layers) = layers.filter(|_| !(smooth && class == "splash")) else {
                        continue;
                    };
                    for (side, layer) in [("front", Layers::FRONT), ("back", Layers::BACK)] {
                        let planes = texels(&layers.texture, layer)?;
                        let name = format!("{aov}.{class}_{side}");
                        if matches!(aov, Aov::Depth | Aov::SmoothDepth) {
                            push(&mut channels, name, &planes, |p| p[3]);
                        } else {
                            let sign = if layer == Layers::FRONT { -1.0 } else { 1.0 };
                            for (i, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
                                push(&mut channels, format!("{name}.{axis}"), &planes, |p| {
                                    let pi = glam::Vec3::new(p[0], p[1], p[2]);
                                    (sign * pi.normalize_or_zero())[i]
                                });
                            }
                        }
                    }
                }
            }
            Aov::SolidDepth => {
                if let Some(gbuffer) = &images.gbuffer {
                    push(&mut channels, aov.to_string(), &texels(&gbuffer.planes, 0)?, |p| p[3]);
                }
            }
            Aov::Radiance => {
                let radiance = texels(&images.radiance.texture, 0)?;
                for (i, color) in ["R", "G", "B"].into_iter().enumerate() {
                    push(&mut channels, format!("{aov}.{color}"), &radiance, |p| p[i]);
                }
            }
            Aov::Interfaces | Aov::Inside | Aov::Iterations | Aov::Failures => {
                if let Some(diagnostics) = &images.diagnostics {
                    let index = match aov {
                        Aov::Interfaces => 0,
                        Aov::Inside => 1,
                        Aov::Iterations => 2,
                        _ => 3,
                    };
                    push(&mut channels, aov.to_string(), &texels(diagnostics, 0)?, |p| p[index]);
                }
            }
            Aov::Caustics => {
                for map in images.caustics.iter().flatten() {
                    maps.push(caustics(gpu, map)?);
                }
            }
        }
    }
    let picture = &images.radiance.texture;
    let size = UVec2::new(picture.width(), picture.height());
    let picture = Part { name: "limpid".into(), size, channels };
    Ok([picture].into_iter().chain(maps).filter(|part| !part.channels.is_empty()).collect())
}

/// Reads the linear picture of the last frame back, as the channels R, G and B that programs take for
/// a picture. It has no alpha: every ray ends at something that radiates.
///
/// # Errors
/// [`Error::DeviceLost`].
pub fn read_radiance(gpu: &Gpu, images: &Images) -> Result<Part> {
    let texture = &images.radiance.texture;
    let texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&gpu::read_texture(gpu, texture, 0)?);
    let mut channels = Vec::new();
    for (i, color) in ["R", "G", "B"].into_iter().enumerate() {
        push(&mut channels, color.into(), &texels, |p| p[i]);
    }
    let size = UVec2::new(texture.width(), texture.height());
    Ok(Part { name: String::new(), size, channels })
}

/// The map of one light.
fn caustics(gpu: &Gpu, map: &CausticMap) -> Result<Part> {
    let size = map.view.size;
    let (irradiance, depth) = map.read(gpu)?;
    let name = format!("caustics.{}", map.layer + 1);
    let mut channels = Vec::new();
    for (i, color) in ["R", "G", "B"].into_iter().enumerate() {
        let values = irradiance.iter().map(|e| e[i]).collect();
        channels.push(Channel { name: format!("irradiance.{color}"), values });
    }
    channels.push(Channel { name: "receiver_depth".into(), values: depth });
    Ok(Part { name, size, channels })
}

fn push(
    channels: &mut Vec<Channel>,
    name: String,
    texels: &[[f32; 4]],
    value: impl Fn(&[f32; 4]) -> f32,
) {
    channels.push(Channel { name, values: texels.iter().map(value).collect() });
}

/// Writes the parts into one `OpenEXR` file, under a temporary name that is then renamed.
///
/// # Errors
/// [`Error::Io`] naming the file.
pub fn write(path: &Path, parts: Vec<Part>) -> Result<()> {
    let lossless = Encoding::FAST_LOSSLESS;
    write_atomically(path, Kind::Picture, |file| encode(parts, lossless, None, file))
}

/// As [`write()`], with what the images were made from: [`is_whole`].
///
/// # Errors
/// As [`write()`].
pub fn write_frame(path: &Path, parts: Vec<Part>, fingerprint: Fingerprint) -> Result<()> {
    let lossless = Encoding::FAST_LOSSLESS;
    write_atomically(path, Kind::Picture, |file| encode(parts, lossless, Some(fingerprint), file))
}

/// Whether the file is there, can be read to its end, and was made from this.
pub fn is_whole(path: &Path, fingerprint: Fingerprint) -> bool {
    let expected = fingerprint.to_string();
    let matches = |header: &Header| {
        // A file does not tell which of its attributes are all layers'.
        let attributes = [&header.shared_attributes.other, &header.own_attributes.other];
        attributes.iter().any(|attributes| match attributes.get(FINGERPRINT.as_bytes()) {
            Some(AttributeValue::Text(text)) => text.to_string() == expected,
            _ => false,
        })
    };
    // The head first, which is quick.
    let Ok((file, _)) = files::open(path) else { return false };
    let head = MetaData::read_from_unbuffered(file, false);
    head.is_ok_and(|head| head.headers.iter().all(matches)) && load(path).is_ok()
}

/// Writes the parts as the bytes of one `OpenEXR` file; there must be one.
pub(crate) fn encode(
    parts: Vec<Part>,
    encoding: Encoding,
    fingerprint: Option<Fingerprint>,
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
    let shown = IntegerBounds::from_dimensions((size.x as usize, size.y as usize));
    let mut attributes = ImageAttributes::new(shown);
    if let Some(fingerprint) = fingerprint {
        let text = AttributeValue::Text(fingerprint.to_string().as_str().into());
        attributes.other.insert(FINGERPRINT.into(), text);
    }
    let image = Image::from_layers(attributes, layers);
    image.write().to_buffered(to).map_err(io::Error::other)
}

/// Reads the parts of an `OpenEXR` file such as [`write()`] writes: channels in the order of their
/// names, numbers of any width as 32-bit floats.
///
/// # Errors
/// [`Error::Io`], [`Error::Malformed`] for a damaged file, and [`Error::Format`] for one that is no
/// `OpenEXR`, holds deep data, or claims more pixels than it can hold.
pub fn load(path: &Path) -> Result<Vec<Part>> {
    let mut bytes = Vec::new();
    files::read_picture(path, &mut bytes)?;
    parse(path, &bytes)
}

/// As [`load`], with the contents at hand; `path` stands in messages.
///
/// # Errors
/// As [`load`], without [`Error::Io`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Vec<Part>> {
    files::survive(path, || decode(path, bytes))
}

fn decode(path: &Path, bytes: &[u8]) -> Result<Vec<Part>> {
    if !bytes.starts_with(&exr::meta::magic_number::BYTES) {
        return Err(Error::format(path, "not an OpenEXR file"));
    }
    let mut cursor = io::Cursor::new(bytes);
    let meta = MetaData::read_from_buffered(&mut cursor, false);
    let damaged = |cursor: &io::Cursor<&[u8]>, error: exr::error::Error| match error {
        exr::error::Error::NotSupported(problem) => Error::format(path, problem),
        error => Error::malformed(path, Place::Byte(cursor.position()), error.to_string()),
    };
    let meta = meta.map_err(|e| damaged(&cursor, e))?;
    let limits = files::picture_limits(bytes).map_err(|problem| Error::format(path, problem))?;
    let floats = meta.headers.iter().map(|header| {
        let channels = header.channels.list.len() as u128;
        header.layer_size.0 as u128 * header.layer_size.1 as u128 * channels
    });
    let most = limits.max_alloc.map_or(u128::MAX, u128::from);
    if floats.sum::<u128>() > most / size_of::<f32>() as u128 {
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
