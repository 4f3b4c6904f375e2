//! Intermediate images (AOVs) as float channels, to find the pass that causes an artefact.

use std::fmt;
use std::str::FromStr;

use glam::UVec2;
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::passes::Layers;
use crate::passes::caustics::CausticMap;
use crate::passes::diffuse;
use crate::passes::surface::SurfaceImages;
use crate::renderer::Images;

/// A kind of intermediate image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Aov {
    /// Depth of the first interface, `depth.Z`, and of each splatted layer, m; 0 where empty.
    Depth,
    /// Outward unit normal of the first interface, `normal.X` and so on, and of each splatted layer, view
    /// space; 0 where empty.
    Normal,
    /// Pixels that the first interface has moved since the frame before, `motion.X` (right) and `motion.Y`
    /// (down).
    Motion,
    /// Share of each pixel that liquid covers, 0 to 1: `coverage.A`.
    Coverage,
    /// The same for each fluid, counted from 1: `mask.fluid1` and so on.
    Mask,
    /// Share of each pixel that foam, spray, bubbles and dust cover, 0 to 1: `diffuse.coverage`, and its parts in the air and,
    /// seen through the first surface, in the liquid: `diffuse.air` and `diffuse.liquid`.
    Diffuse,
    /// Value that colours an opaque body's surface, in the unit of the data; 0 where empty.
    Value,
    /// Depth of each smoothed aggregate layer, m.
    SmoothDepth,
    /// Outward unit normal of each smoothed aggregate layer, view space.
    SmoothNormal,
    /// Depth of the opaque scene, m.
    SolidDepth,
    /// Linear radiance before tone mapping.
    Radiance,
    /// Interfaces crossed per ray.
    Interfaces,
    /// Path length inside the liquid per ray, m.
    Inside,
    /// Layer evaluations by the intersector per ray.
    Iterations,
    /// Intersector failures per ray.
    Failures,
    /// Caustic map of each light, in the light's view: irradiance of light through liquid, W/m², and
    /// receiver depth, m.
    Caustics,
}

impl Aov {
    /// All AOVs.
    pub const ALL: [Self; 16] = [
        Self::Depth,
        Self::Normal,
        Self::Motion,
        Self::Coverage,
        Self::Mask,
        Self::Diffuse,
        Self::Value,
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

    /// Whether it needs [`FrameInput::surface`]: images for programs that compose pictures.
    ///
    /// [`FrameInput::surface`]: crate::frame::FrameInput::surface
    pub fn is_for_compositing(self) -> bool {
        matches!(self, Self::Motion | Self::Coverage | Self::Mask)
    }

    fn name(self) -> &'static str {
        match self {
            Self::Depth => "depth",
            Self::Normal => "normal",
            Self::Motion => "motion",
            Self::Coverage => "coverage",
            Self::Mask => "mask",
            Self::Diffuse => "diffuse",
            Self::Value => "value",
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
            Error::invalid("aov", format!("no `{text}`; there are all, {}", known.join(", ")))
        })
    }
}

/// Parses a list such as `depth,normal`, or `all`.
///
/// # Errors
/// [`Error::Invalid`] naming the unknown entry.
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

/// Channels of one resolution: a part of an `OpenEXR` file.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// `limpid` for images at picture resolution, `caustics.1` for the map of the first light; empty
    /// for a single picture.
    pub name: String,
    /// Width and height, pixels.
    pub size: UVec2,
    /// The channels.
    pub channels: Vec<Channel>,
}

impl Part {
    /// The part of a picture of which each pixel was drawn as `side`² smaller ones: the means of radiance, coverage and
    /// masks, and the middle value of images that cannot be averaged across an edge.
    pub(crate) fn reduced(self, side: u32) -> Self {
        if side == 1 || self.name.starts_with("caustics") {
            return self;
        }
        let size = self.size / side;
        let row = self.size.x as usize;
        let reduce = |Channel { name, values }: Channel| {
            let is_mean = ["R", "G", "B", "A", "radiance", "coverage", "mask", "diffuse"];
            let is_mean = is_mean.contains(&name.split('.').next().unwrap_or_default());
            // Motion is in pixels.
            let unit = if name.starts_with("motion") { 1.0 / side as f32 } else { 1.0 };
            let pixel = |(x, y): (u32, u32)| {
                let at = |i: u32, j: u32| {
                    values[(y * side + j) as usize * row + (x * side + i) as usize]
                };
                match is_mean {
                    true => {
                        let all = (0..side).flat_map(|j| (0..side).map(move |i| (i, j)));
                        all.map(|(i, j)| at(i, j)).sum::<f32>() / (side * side) as f32
                    }
                    false => unit * at(side / 2, side / 2),
                }
            };
            let pixels = (0..size.y).flat_map(|y| (0..size.x).map(move |x| (x, y)));
            Channel { values: pixels.map(pixel).collect(), name }
        };
        Self { size, channels: self.channels.into_iter().map(reduce).collect(), ..self }
    }
}

/// Reads the chosen images of the last frame back from the device: first those at picture resolution,
/// then the caustic maps.
///
/// Images that the frame lacks (splash layers without splashes) yield no channels.
///
/// # Errors
/// [`Error::DeviceLost`].
#[cfg(not(target_arch = "wasm32"))]
pub fn read(gpu: &Gpu, images: &Images, chosen: &[Aov]) -> Result<Vec<Part>> {
    pollster::block_on(finish(gpu, images, chosen))
}

/// The texels of one layer of a texture.
async fn texels(gpu: &Gpu, texture: &wgpu::Texture, layer: u32) -> Result<Vec<[f32; 4]>> {
    let bytes = gpu.begin_reading(texture, layer).finish(gpu).await?;
    Ok(bytemuck::pod_collect_to_vec(&bytes))
}

/// Coverage of each pixel by spheres, from their sums.
async fn covered(gpu: &Gpu, sums: &wgpu::Buffer) -> Result<Vec<f32>> {
    let bytes = gpu.begin_reading_buffer(sums).finish(gpu).await?;
    let sums: Vec<[u32; 4]> = bytemuck::pod_collect_to_vec(&bytes);
    Ok(diffuse::covered(&sums))
}

/// As `read`, for code that browsers and other programs share: waiting yields in a browser and blocks elsewhere.
///
/// # Errors
/// [`Error::DeviceLost`].
pub async fn finish(gpu: &Gpu, images: &Images, chosen: &[Aov]) -> Result<Vec<Part>> {
    let mut channels = Vec::new();
    let mut maps = Vec::new();
    for &aov in chosen {
        if let Some(surface) = &images.surface {
            first_interface(gpu, &mut channels, aov, surface, images.fluids).await?;
        }
        match aov {
            Aov::Motion | Aov::Coverage | Aov::Mask => {}
            Aov::Depth | Aov::Normal | Aov::SmoothDepth | Aov::SmoothNormal => {
                let smooth = matches!(aov, Aov::SmoothDepth | Aov::SmoothNormal);
                let aggregate = if smooth { &images.smoothed } else { &images.aggregate };
                let classes = [("aggregate", Some(aggregate)), ("splash", images.splash.as_ref())];
                for (class, layers) in classes {
                    let Some(layers) = layers.filter(|_| !(smooth && class == "splash")) else {
                        continue;
                    };
                    for (side, layer) in [("front", Layers::FRONT), ("back", Layers::BACK)] {
                        let planes = texels(gpu, &layers.texture, layer).await?;
                        let name = format!("{aov}.{class}_{side}");
                        if matches!(aov, Aov::Depth | Aov::SmoothDepth) {
                            // Without its flag.
                            push(&mut channels, name, &planes, |p| p[3].abs());
                        } else {
                            let sign = if layer == Layers::FRONT { -1.0 } else { 1.0 };
                            for (i, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
                                push(&mut channels, format!("{name}.{axis}"), &planes, |p| {
                                    let pi = glam::Vec3::new(p[0], p[1], p[2]);
                                    let away = match images.orthographic && pi != glam::Vec3::ZERO {
                                        true => pi.truncate().extend(-1.0),
                                        false => pi,
                                    };
                                    (sign * away.normalize_or_zero())[i]
                                });
                            }
                        }
                    }
                }
            }
            Aov::Diffuse => {
                let Some(sums) = &images.diffuse else { continue };
                let [air, liquid] = [covered(gpu, &sums[0]).await?, covered(gpu, &sums[1]).await?];
                let both = air.iter().zip(&liquid).map(|(a, b)| a + (1.0 - a) * b).collect();
                for (name, values) in [("coverage", both), ("air", air), ("liquid", liquid)] {
                    channels.push(Channel { name: format!("{aov}.{name}"), values });
                }
            }
            Aov::Value => {
                let Some((colors, map)) = &images.colors else { continue };
                let places = texels(gpu, colors, 0).await?;
                let mut depths = vec![texels(gpu, &images.smoothed.texture, Layers::FRONT).await?];
                if let Some(splash) = &images.splash {
                    depths.push(texels(gpu, &splash.texture, Layers::FRONT).await?);
                }
                let is_liquid = |i: usize| depths.iter().any(|planes| planes[i][..3] != [0.0; 3]);
                let value = |(i, place): (usize, &[f32; 4])| {
                    if is_liquid(i) { map.value(place[3]) } else { 0.0 }
                };
                let values = places.iter().enumerate().map(value).collect();
                channels.push(Channel { name: aov.to_string(), values });
            }
            Aov::SolidDepth => {
                if let Some(gbuffer) = &images.gbuffer {
                    let planes = texels(gpu, &gbuffer.planes, 0).await?;
                    push(&mut channels, aov.to_string(), &planes, |p| p[3]);
                }
            }
            Aov::Radiance => {
                let radiance = texels(gpu, &images.radiance.texture, 0).await?;
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
                    let counts = texels(gpu, diagnostics, 0).await?;
                    push(&mut channels, aov.to_string(), &counts, |p| p[index]);
                }
            }
            Aov::Caustics => {
                for (light, map) in (1..).zip(&images.caustics) {
                    if let Some(map) = map {
                        maps.push(caustics(gpu, map, light).await?);
                    }
                }
            }
        }
    }
    let picture = &images.radiance.texture;
    let size = UVec2::new(picture.width(), picture.height());
    let picture = Part { name: "limpid".into(), size, channels };
    Ok([picture].into_iter().chain(maps).filter(|part| !part.channels.is_empty()).collect())
}

/// Reads a linear picture back as channels R, G and B, the names by which other programs recognise a picture, and if its
/// coverage varies (`transparent`) as A, by which the colours are multiplied.
#[cfg(not(target_arch = "wasm32"))]
pub(crate) fn read_linear(gpu: &Gpu, texture: &wgpu::Texture, transparent: bool) -> Result<Part> {
    pollster::block_on(finish_linear(gpu, texture, transparent))
}

/// As [`read_linear`]; waits as [`finish`].
pub(crate) async fn finish_linear(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    transparent: bool,
) -> Result<Part> {
    let texels = texels(gpu, texture, 0).await?;
    let mut channels = Vec::new();
    let count = if transparent { 4 } else { 3 };
    for (i, color) in ["R", "G", "B", "A"].into_iter().take(count).enumerate() {
        push(&mut channels, color.into(), &texels, |p| p[i]);
    }
    let size = UVec2::new(texture.width(), texture.height());
    Ok(Part { name: String::new(), size, channels })
}

/// Adds the channels of the first interface that belong to an AOV.
async fn first_interface(
    gpu: &Gpu,
    channels: &mut Vec<Channel>,
    aov: Aov,
    images: &SurfaceImages,
    fluids: usize,
) -> Result<()> {
    let texels = async |texture: &wgpu::Texture| texels(gpu, texture, 0).await;
    let mut add = |name: &str, texels: &[[f32; 4]], value: &dyn Fn(&[f32; 4]) -> f32| {
        push(channels, format!("{aov}.{name}"), texels, value);
    };
    match aov {
        Aov::Depth => add("Z", &texels(&images.surface).await?, &|p| p[3]),
        Aov::Normal => {
            let normals = texels(&images.surface).await?;
            for (i, axis) in ["X", "Y", "Z"].into_iter().enumerate() {
                add(axis, &normals, &|p| p[i]);
            }
        }
        Aov::Motion => {
            let motion = texels(&images.motion).await?;
            add("X", &motion, &|p| p[0]);
            add("Y", &motion, &|p| p[1]);
        }
        Aov::Coverage => add("A", &texels(&images.motion).await?, &|p| p[2]),
        Aov::Mask => {
            let covered = texels(&images.motion).await?;
            for fluid in 0..fluids {
                let mask = |p: &[f32; 4]| if p[3] as usize == fluid { p[2] } else { 0.0 };
                add(&format!("fluid{}", fluid + 1), &covered, &mask);
            }
        }
        _ => {}
    }
    Ok(())
}

/// Reads the caustic map of a light back. Lights are numbered from 1.
async fn caustics(gpu: &Gpu, map: &CausticMap, light: usize) -> Result<Part> {
    let size = map.view.size;
    let (irradiance, depth) = map.finish(gpu).await?;
    let name = format!("caustics.{light}");
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
