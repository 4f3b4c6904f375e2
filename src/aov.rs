//! Intermediate images as `OpenEXR` channels, to find the stage that is to blame.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use exr::prelude::LayerAttributes;
use exr::prelude::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, WritableImage};

use crate::error::{Error, Result};
use crate::gpu::{self, Gpu};
use crate::passes::Layers;
use crate::renderer::Images;

/// A kind of intermediate image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
}

impl Aov {
    /// All of them.
    pub const ALL: [Self; 10] = [
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

/// Reads the chosen images of the last frame back from the device.
///
/// Images that the frame did not have (splash layers without splashes) have no channels.
///
/// # Errors
/// [`Error::DeviceLost`].
pub fn read(gpu: &Gpu, images: &Images, chosen: &[Aov]) -> Result<Vec<Channel>> {
    let mut channels = Vec::new();
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
        }
    }
    Ok(channels)
}

fn push(
    channels: &mut Vec<Channel>,
    name: String,
    texels: &[[f32; 4]],
    value: impl Fn(&[f32; 4]) -> f32,
) {
    channels.push(Channel { name, values: texels.iter().map(value).collect() });
}

/// Writes channels into one `OpenEXR` file, under a temporary name that is then renamed.
///
/// # Errors
/// [`Error::Io`] naming the file.
pub fn write(path: &Path, width: u32, height: u32, channels: Vec<Channel>) -> Result<()> {
    let list = channels
        .into_iter()
        .map(|c| AnyChannel::new(c.name.as_str(), FlatSamples::F32(c.values)))
        .collect();
    let layer = Layer::new(
        (width as usize, height as usize),
        LayerAttributes::named("limpid"),
        Encoding::FAST_LOSSLESS,
        AnyChannels::sort(list),
    );
    crate::output::write_atomically(path, |file| {
        Image::from_layer(layer).write().to_buffered(file).map_err(std::io::Error::other)
    })
}
