//! A frame of particles that is ready to draw.

use std::borrow::Cow;
use std::sync::Arc;

use glam::{DVec3, UVec2, Vec3};
use limpid::camera::View;
use limpid::diffuse::{Diffuse, DiffuseKind};
use limpid::frame::FrameInput;
use limpid::liquid::Up;
use limpid::liquid::bulk::Bulk;
use limpid::liquid::classify::{Splat, Splats};
use limpid::scene::Scene;
use serde::{Deserialize, Serialize};

#[cfg(doc)]
use super::{Input, Loader};
#[cfg(doc)]
use crate::adjustments::Adjustments;
use crate::particles::{Array, Remark};
use crate::project::Moved;

/// The origin of a particle radius, the most reliable first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum RadiusFrom {
    /// Their file has radii.
    #[default]
    File,
    /// The user: [`Input::with_radius`].
    Option,
    /// The scene, its recipe or its simulation.
    Scene,
    /// Their spacing: [`limpid::liquid::classify::estimate_radius`].
    Guess,
}

/// The origin of the axis that points up in the files, the most reliable first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum UpFrom {
    /// The user: [`Adjustments::up`].
    Option,
    /// The scene, its recipe or its simulation.
    Scene,
    /// The format, or the names of the arrays, of this program.
    Format(&'static str),
    /// The particles, which lie in a plane: the other of y and z.
    Flat,
    /// The surface of the liquid: [`limpid::liquid::likely_up`]. Of bare particles alone.
    Guess,
    /// Nothing: y is taken to point up.
    #[default]
    Default,
}

impl UpFrom {
    /// A word for it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Option => "option",
            Self::Scene => "scene",
            Self::Format(program) => program,
            Self::Flat => "flat",
            Self::Guess => "guessed",
            Self::Default => "default",
        }
    }
}

/// A frame of particles, ready to draw.
#[derive(Debug, Clone, Default)]
pub struct Loaded {
    /// Number of the frame; between two frames, of the previous one.
    pub number: i64,
    /// Number of particles in the file.
    pub particles: usize,
    /// The classified particles.
    pub splats: Splats,
    /// Foam, spray, bubbles and dust, if there are any.
    pub diffuse: Option<Arc<Diffuse>>,
    /// Number of diffuse particles of each kind: [`Diffuse::counts`].
    pub diffuse_counts: [usize; DiffuseKind::ALL.len()],
    /// Number of splashes among the particles.
    pub splashes: usize,
    /// Origin of the radius; with several fluids, the least reliable.
    pub radius_from: RadiusFrom,
    /// The axis that points up in the files, and how that is known; see [`Loader::up`].
    pub up: (Up, UpFrom),
    /// Bounds of all centres; both 0 without particles.
    pub bounds: (DVec3, DVec3),
    /// Arrays of the files other than the positions, used or ignored; see [`crate::particles::Contents::arrays`].
    pub arrays: Vec<Array>,
    /// Cells of meshes in the files; see [`crate::particles::Contents::cells`].
    pub cells: usize,
    /// Remarks on the files; see [`crate::particles::Contents::remarks`].
    pub remarks: Vec<Remark>,
    /// Bounds of the bulk of the particles, for cameras, and the number outside; all 0 without
    /// particles.
    pub bulk: Bulk,
    /// Where the scene's solids are, if they move.
    pub moved: Moved,
    /// Velocity of each particle, m/s, if [`Loader::with_velocities`] is set and the files have them.
    pub velocities: Vec<Vec3>,
}

impl Loaded {
    /// Memory of the frame, bytes.
    pub fn bytes(&self) -> u64 {
        let splats = self.splats.aggregates.capacity() + self.splats.splashes.capacity();
        let velocities = self.velocities.capacity() * size_of::<Vec3>();
        // Position, velocity, radius, kind, age and lifetime.
        const DIFFUSE: usize = 2 * size_of::<Vec3>() + 3 * size_of::<f32>() + 1;
        let diffuse = self.diffuse.as_ref().map_or(0, |diffuse| diffuse.len() * DIFFUSE);
        let own = size_of::<Self>() + splats * size_of::<Splat>() + velocities + diffuse;
        own as u64 + self.moved.bytes()
    }

    /// A picture of the frame alone, of `size` pixels, in [its scene](Self::scene).
    pub fn picture<'a>(
        &'a self,
        scene: &'a Scene,
        view: impl Into<View>,
        size: UVec2,
    ) -> FrameInput<'a> {
        FrameInput {
            diffuse: self.diffuse.as_ref(),
            ..FrameInput::new(scene, view, &self.splats, size)
        }
    }

    /// The scene to draw the frame in: its solids are where they are then. `scene` is the one that the frame was
    /// loaded for, with whatever settings.
    pub fn scene<'a>(&self, scene: &'a Scene) -> Cow<'a, Scene> {
        self.moved.scene(scene)
    }
}
