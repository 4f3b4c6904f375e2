//! Files for [`limpid`]: particle formats, sequences, scenes, pictures and films.
//!
//! [`open::Request`] opens an input, [`input::Loader`] loads its frames, [`frame_cache::FrameCache`]
//! loads them ahead of playback, and [`output`] and [`film::Film`] write pictures and films. [`quality`] chooses
//! settings by error or time.
//!
//! ```no_run
//! use limpid::offscreen::Offscreen;
//! use limpid_io::{device, output, open::Request};
//!
//! # fn main() -> limpid_io::Result<()> {
//! let request = Request { input: Some("frames/water_{}.bgeo".into()), ..Request::default() };
//! let opened = request.open()?;
//! let (loader, project) = (opened.loader, opened.project);
//! let loaded = loader.load(&loader.sequence.frames[0], &project.scene)?;
//! let camera = project.camera_for(loaded.bulk.bounds);
//! let mut offscreen = Offscreen::new(&device::open()?);
//! let size = limpid::glam::UVec2::new(1024, 768);
//! let scene = loaded.scene(&project.scene);
//! let drawn = offscreen.draw(loaded.picture(&scene, &camera, size))?;
//! output::write_png("water.png".as_ref(), &drawn.picture)?;
//! # Ok(())
//! # }
//! ```

//!
//! In a browser, files are those that a page gives or a server has (`files::given`), and nothing writes any: films,
//! claims and `device` are left out there.

#![forbid(unsafe_code)]

pub mod adjustments;
pub mod bake;
mod budget;
pub mod camera_axes;
pub mod camera_path;
#[cfg(not(target_arch = "wasm32"))]
pub mod claim;
pub mod color_by;
#[cfg(not(target_arch = "wasm32"))]
pub mod device;
pub mod environment;
pub mod error;
pub mod exr;
#[doc(hidden)]
pub mod files;
#[cfg(not(target_arch = "wasm32"))]
pub mod film;
mod floor;
pub mod frame_cache;
pub mod frames;
mod identity;
pub mod input;
pub mod media;
pub mod meshes;
pub mod notice;
mod number;
pub mod open;
pub mod output;
pub mod overlay;
pub mod particles;
mod pattern;
pub mod project;
pub mod quality;
pub mod sequence;
pub mod shared_classifier;
pub mod spread;
mod vtk_lists;
#[cfg(not(target_arch = "wasm32"))]
pub mod whitewater;

pub use error::{Error, Result};

/// The example of the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
