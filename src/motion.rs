//! What moves between frames, for motion vectors.

use glam::Vec3;

use crate::camera::View;

/// How a frame differs from the one before: [`Renderer::surface`].
///
/// [`Renderer::surface`]: crate::renderer::Renderer::surface
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Motion {
    /// Velocity of each particle, m/s, in the order of the particles; empty if they are at rest.
    pub velocities: Vec<Vec3>,
    /// Time since the frame before, s.
    pub seconds: f32,
    /// The view of the frame before; `None` if it is the same. Perspective or orthographic as this frame's.
    pub previous: Option<View>,
}
