//! limpid draws clear liquid straight from particles: particle files in, refracted pictures out.
//!
//! # The pipeline
//!
//! ```text
//! particle file ─ Particles ─ classify ─ Splats ─ splat ─ Layers ─ smooth ─┐
//! scene ─ solids, environment ─ gbuffer ─ GBuffer ─────────────────────────┤
//! lights ─ the same, seen from the light ─ caustics ─ CausticMap ──────────┤
//!                                               refract ─ Radiance ─ tonemap ─ picture
//! ```
//!
//! 1. [`particles::Particles::read`] reads one frame; [`sequence::Sequence`] finds the frames.
//! 2. [`passes::classify`] separates splashes from aggregates and shapes each as an ellipsoid.
//! 3. [`passes::splat`] draws them into four layers of tangent planes, front and back of each.
//! 4. [`passes::smooth`] fits planes to the aggregate layers.
//! 5. [`passes::gbuffer`] draws the opaque scene.
//! 6. [`passes::caustics`] makes a map for each light of what comes through the liquid, from the
//!    [`light_view::LightView`]'s own layers; only if something is lit.
//! 7. [`passes::refract`] follows light through up to four interfaces, with absorption.
//! 8. [`passes::tonemap`] turns radiance into a picture.
//!
//! Sequences: [`ring::Ring`] loads frames ahead of whoever plays them, [`input::Moment`]s lie between
//! frames, [`studio::Studio`] draws into memory, [`camera_path::CameraPath`] moves the camera, and
//! [`film::Film`] writes what was drawn. Several fluids share the layers; [`passes::mixture`] tells
//! their colours apart.
//!
//! Farms: a [`fingerprint`] in each picture tells whether it is to be drawn again, and a [`claim`]
//! whose it is to draw, on all machines that share a folder.
//!
//! [`renderer::Renderer::render`] is the frame on one page. A pass is one file of `src/passes/`,
//! one of `shaders/`, one struct of [`settings`], one row of the times.
//!
//! # Conventions
//!
//! Right-handed world, y up, metres, linear RGB radiance. Places in the world are 64-bit; what
//! becomes 32-bit is counted from the eye or from an origin near by, so that scenes keep their
//! digits far from the world's origin. View space is x right, y up, looking down −z; *depth* is `z = −z_view > 0`, *disparity* is 1/z. Pixel (i, j) has its centre at
//! (i + ½, j + ½), y down. Transforms are named `a_from_b`. NaN and ∞ are never values.
//!
//! # Use
//!
//! ```no_run
//! use limpid::{gpu::Gpu, output, project::open::Request, studio::Studio};
//!
//! # fn main() -> limpid::Result<()> {
//! let gpu = Gpu::headless()?;
//! let mut studio = Studio::new(&gpu);
//! let request = Request { input: Some("frames/water_{}.bgeo".into()), ..Request::default() };
//! let opened = request.open()?;
//! let (input, project) = (opened.input, opened.project);
//! let loaded = input.load(&input.sequence.frames[0], &project)?;
//! let camera = project.camera_for(loaded.bulk.bounds);
//! let shot = studio.draw(&project.scene, &camera, &loaded.splats, glam::UVec2::new(1024, 768))?;
//! output::write_png("water.png".as_ref(), &shot.picture)?;
//! # Ok(())
//! # }
//! ```
//!
//! Where particles change with every frame, the device may classify them:
//! `input.classified(Place::on(&gpu))`, see [`passes::classify::Place`].
//!
//! To draw into a texture of your own program, see [`gpu::Gpu::from_device`] and
//! `examples/embed.rs`.

#![forbid(unsafe_code)]

pub mod aov;
pub mod bulk;
pub mod camera;
pub mod camera_path;
mod changes;
pub mod check;
pub mod claim;
pub mod compare;
mod counting_sort;
pub mod environment;
pub mod error;
mod files;
pub mod film;
pub mod fingerprint;
pub mod frames;
pub mod gpu;
pub mod input;
pub mod light_view;
mod lights;
mod memory;
pub mod notice;
pub mod output;
mod page;
pub mod particles;
pub mod passes;
pub mod project;
pub mod quality;
pub mod recipe;
#[cfg(feature = "report")]
pub mod reference;
pub mod renderer;
#[cfg(feature = "report")]
pub mod report;
pub mod ring;
pub mod scene;
pub mod sequence;
pub mod settings;
pub mod shader;
pub mod sim;
pub mod studio;
#[cfg(feature = "viewer")]
pub mod viewer;
pub mod waves;

pub use error::{Error, Result};
pub use {glam, wgpu};
