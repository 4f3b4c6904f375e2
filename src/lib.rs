//! limpid draws clear liquid straight from particles.
//!
// `docs/pictures/lagoon.png` as WebP, within the text: documentation of a crate holds no files beside it.
#![doc = include_str!("front_picture.md")]
//!
//! This crate is only the renderer: it takes particles, a scene and a camera, and draws into a texture
//! or into memory. Files, sequences and films are in `limpid-io`, simulations in `limpid-sim`, ground
//! truth and reports in `limpid-lab`.
//!
//! # The pipeline
//!
//! ```text
//! Particles ─ classify ─ Splats ─ splat ─ Layers ─ smooth ───────┐
//! Scene ─ solids, environment ───────────────────────────────────┤
//! lights ─ the same from the light ─ caustics ─ CausticMap ──────┤
//!                                      refract ─ Radiance ─ tonemap ─ picture
//! ```
//!
//! 1. [`liquid::classify`] splits particles into splashes and aggregates and gives each an ellipsoid.
//! 2. `splat` draws them into layers of tangent planes: the front and the back of each class. `gaps` adds two layers for
//!    each interval of air between liquid and liquid.
//! 3. `smooth` fits planes to the aggregate layers.
//! 4. `caustics` renders one map per light of the light that passed through liquid, from the layers of
//!    its [`light_view::LightView`]; only if a solid is lit.
//! 5. `refract` traces rays through up to four interfaces, with absorption, to solids and environment.
//! 6. `tonemap` turns radiance into a picture.
//!
//! [`renderer::Renderer::render`] is the whole frame on one page. A pass is one file in `src/passes/`, one
//! in `shaders/`, one struct in [`settings`] and one row in the pass times.
//!
//! # Conventions
//!
//! Right-handed world, y up, metres, linear RGB radiance. World positions are 64-bit; 32-bit positions
//! are relative to the eye or to a nearby origin, so that scenes far from the world origin keep their
//! precision. View space is x right, y up, looking down −z; *depth* is `z = −z_view > 0`, *disparity* is
//! 1/z. Pixel (i, j) has its centre at (i + ½, j + ½), y down. Transforms are named `a_from_b`. No value
//! is NaN or ∞.
//!
//! # Use
//!
//! ```no_run
//! use limpid::camera::Camera;
//! use limpid::glam::{DVec3, UVec2, Vec3};
//! use limpid::liquid::{Particles, classify::classify};
//! use limpid::{frame::FrameInput, gpu::Gpu, offscreen::Offscreen, scene::Scene};
//!
//! # fn main() -> limpid::Result<()> {
//! let lattice = (0..8000).map(|i| 0.05 * Vec3::new((i % 20) as f32, (i / 400) as f32, (i / 20 % 20) as f32));
//! let (particles, radius) = (Particles::from_positions(lattice.collect()), 0.025);
//! let (min, max) = particles.bounds().unwrap_or_default();
//! let scene = Scene::around(min, max, radius);
//! let splats = classify(&particles, radius, &scene.settings.classify);
//! let mut offscreen = Offscreen::new(&Gpu::headless()?);
//! let (camera, size) = (Camera::fit(min, max), UVec2::new(1024, 768));
//! let shot = offscreen.draw(FrameInput::new(&scene, &camera, &splats, size))?;
//! let picture: image::RgbImage = shot.picture;
//! # Ok(())
//! # }
//! ```
//!
//! To draw into a texture of another program, see [`gpu::Gpu::from_device`] and the example `embed` of
//! `limpid-io`.

#![forbid(unsafe_code)]

pub mod aov;
#[doc(hidden)]
pub mod background;
pub mod camera;
pub mod diffuse;
mod dirty;
pub mod environment;
pub mod error;
pub mod frame;
pub mod gpu;
pub mod host;
pub mod light_view;
#[doc(hidden)]
pub mod lights;
pub mod liquid;
pub mod look;
#[doc(hidden)]
pub mod memory;
pub mod mesh;
pub mod motion;
#[cfg(feature = "image")]
pub mod offscreen;
mod opaque_fluids;
#[doc(hidden)]
pub mod passes;
pub mod renderer;
pub mod scene;
pub mod settings;
#[doc(hidden)]
pub mod sims;
mod up_axis;
mod view_range;

pub use error::{Error, Result};
pub use {glam, wgpu};
