//! How fast and how wrong limpid is: the ground truth and what is measured against it, and the measures themselves.

mod budget;
mod caustics;
mod caustics_truth;
mod classify_device;
mod compare;
mod conic;
mod device_particles;
mod diffuse;
mod elisions;
mod even_light;
mod intervals;
mod lights;
mod meshes;
mod quality;
mod reference;
mod report;
mod shaders;
mod stability;
#[path = "../../../../tests/support/mod.rs"]
mod support;
mod truth;
mod turbid;
