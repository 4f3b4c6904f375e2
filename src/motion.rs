//! Motion of camera and particles between frames, for motion vectors.

use glam::Vec3;
use rayon::prelude::*;

use crate::camera::View;
use crate::error::{Error, Result};
use crate::liquid::classify::Splats;

/// How a frame differs from the one before: [`FrameInput::surface`].
///
/// [`FrameInput::surface`]: crate::frame::FrameInput::surface
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Motion {
    /// Velocity of each particle, m/s, in the order of the particles, also of those on the device; empty if they are at rest.
    pub velocities: Vec<Vec3>,
    /// Time since the frame before, s.
    pub seconds: f32,
    /// The view of the frame before; `None` if it is the same. Perspective or orthographic as this frame's.
    /// With jittered views, motion contains the difference of the jitters, unless this view has this frame's
    /// jitter. Surfaces behind its eye have no motion.
    pub previous: Option<View>,
}

impl Motion {
    /// Fails if it does not belong to the frame.
    pub(crate) fn check(&self, view: &View, splats: &Splats) -> Result<()> {
        let fail = |problem: String| Err(Error::invalid("motion", problem));
        if let Some(previous) = &self.previous {
            previous.check()?;
            if previous.is_orthographic() != view.is_orthographic() {
                return fail("one of this view and the one before is orthographic".into());
            }
        }
        if self.velocities.is_empty() {
            return Ok(());
        }
        let all = splats.aggregates.par_iter().chain(&splats.splashes);
        let on_host = all.map(|splat| splat.particle as usize + 1).max().unwrap_or(0);
        let needed = splats.device.as_ref().map_or(on_host, |device| device.members as usize);
        match self.velocities.len() {
            known if known < needed => {
                fail(format!("{known} velocities are given for {needed} particles"))
            }
            _ => Ok(()),
        }
    }
}
