//! limpid draws clear liquid straight from particles.
//!
//! This crate is the renderer alone: it takes particles, a scene and a camera, and draws into a texture
//! or into memory. Files, sequences and films are in `limpid-io`, simulations in `limpid-sim`, ground
//! truth and reports in `limpid-lab`.
//!
//! # The pipeline
//!
//! ```text
//! Particles ─ classify ─ Splats ─ splat ─ Layers ─ smooth ───────┐
//! Scene ─ solids, environment ─ gbuffer ─ GBufferImages ─────────┤
//! lights ─ the same from the light ─ caustics ─ CausticMap ──────┤
//!                                      refract ─ Radiance ─ tonemap ─ picture
//! ```
//!
//! 1. [`liquid::classify`] separates splashes from aggregates and shapes each as an ellipsoid.
//! 2. `splat` draws them into four layers of tangent planes, front and back of each.
//! 3. `smooth` fits planes to the aggregate layers.
//! 4. `gbuffer` draws the opaque scene.
//! 5. `caustics` makes a map for each light of what comes through the liquid, from the
//!    [`light_view::LightView`]'s own layers; only if something is lit.
//! 6. `refract` follows light through up to four interfaces, with absorption.
//! 7. `tonemap` turns radiance into a picture.
//!
//! [`renderer::Renderer::render`] is the frame on one page. A pass is one file of `src/passes/`, one of
//! `shaders/`, one struct of [`settings`], one row of the times.
//!
//! # Conventions
//!
//! Right-handed world, y up, metres, linear RGB radiance. Places in the world are 64-bit; what
//! becomes 32-bit is counted from the eye or from an origin near by, so that scenes keep their
//! digits far from the world's origin. View space is x right, y up, looking down −z; *depth* is
//! `z = −z_view > 0`, *disparity* is 1/z. Pixel (i, j) has its centre at (i + ½, j + ½), y down.
//! Transforms are named `a_from_b`. NaN and ∞ are never values.
//!
//! # Use
//!
//! ```no_run
//! use limpid::camera::Camera;
//! use limpid::glam::{DVec3, UVec2, Vec3};
//! use limpid::liquid::{Particles, classify::classify};
//! use limpid::{gpu::Gpu, offscreen::Offscreen, scene::Scene};
//!
//! # fn main() -> limpid::Result<()> {
//! let lattice = (0..8000).map(|i| 0.05 * Vec3::new((i % 20) as f32, (i / 400) as f32, (i / 20 % 20) as f32));
//! let (particles, radius) = (Particles::from_positions(lattice.collect()), 0.025);
//! let (min, max) = particles.bounds().unwrap_or_default();
//! let scene = Scene::around(min, max, radius);
//! let splats = classify(&particles, radius, &scene.settings.classify);
//! let mut offscreen = Offscreen::new(&Gpu::headless()?);
//! let shot = offscreen.draw(&scene, &Camera::fit(min, max), &splats, UVec2::new(1024, 768))?;
//! let picture: image::RgbImage = shot.picture;
//! # Ok(())
//! # }
//! ```
//!
//! To draw into a texture of your own program, see [`gpu::Gpu::from_device`] and the example `embed` of
//! `limpid-io`.

#![forbid(unsafe_code)]

pub mod aov;
pub mod camera;
mod dirty;
pub mod environment;
pub mod error;
pub mod gpu;
pub mod light_view;
#[doc(hidden)]
pub mod lights;
pub mod liquid;
#[doc(hidden)]
pub mod memory;
#[cfg(feature = "image")]
pub mod offscreen;
#[doc(hidden)]
pub mod passes;
pub mod renderer;
pub mod scene;
pub mod settings;

pub use error::{Error, Result};
pub use {glam, wgpu};
