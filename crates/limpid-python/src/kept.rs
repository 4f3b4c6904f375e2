//! The last particles, classified: pictures of them from other cameras need them again.

use std::sync::Arc;

use limpid::liquid::{Particles, Up};
use limpid::scene::Scene;
use limpid::settings::Refract;
use limpid_io::color_by::ColorBy;
use limpid_io::input::Loaded;
use limpid_io::project::Project;

use crate::diffuse::Given;
use crate::frames::Setting;

/// Everything that a loaded frame follows from.
#[derive(PartialEq)]
pub(crate) struct Cause {
    particles: Arc<Particles>,
    /// Number of the frame, for solids that move.
    frame: i64,
    radius: Option<f32>,
    has_velocities: bool,
    diffuse: Option<Given>,
    color_by: Option<ColorBy>,
    project: Project,
    up: Up,
}

impl Cause {
    pub(crate) fn new(
        particles: Arc<Particles>,
        frame: i64,
        setting: &Setting,
        color_by: Option<ColorBy>,
    ) -> Self {
        let Setting { radius, motion: has_velocities, .. } = *setting;
        let diffuse = setting.diffuse.clone();
        let (project, up) = Default::default();
        Self { particles, frame, radius, has_velocities, diffuse, color_by, project, up }
    }

    /// With the scene that is drawn, without its settings of pictures alone.
    pub(crate) fn in_project(self, project: &Project, scene: &Scene, up: Up) -> Self {
        let mut scene = scene.clone();
        scene.settings.refract = Refract::default();
        let project = Project { camera: None, scene, ..project.clone() };
        Self { project, up, ..self }
    }
}

/// A loaded frame, and the cause of it.
pub(crate) type Kept = (Cause, Arc<Loaded>);
