//! Input, output and recipes: particle files and sequences, scenes and cameras, recipes and simulations, and
//! pictures that need files. `meshes` and `soak` measure the memory of their process, and are programs of their
//! own.

mod bake;
mod camera_path;
mod diffuse;
mod fluids;
mod frame_cache;
mod input;
mod particles;
mod quality;
mod radius;
mod recipes;
mod scene;
mod sequence;
#[path = "../../../../tests/support/mod.rs"]
mod support;
mod walls;
mod whitewater;
