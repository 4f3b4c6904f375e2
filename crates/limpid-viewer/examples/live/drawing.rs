//! The simulation drawn in daylight: all the calls that draw with limpid.

use limpid::camera::Camera;
use limpid::frame::{FrameInput, Target};
use limpid::glam::{DVec3, UVec2};
use limpid::gpu::Gpu;
use limpid::liquid::classify::Classifier;
use limpid::look::{Body, Look};
use limpid::renderer::Renderer;
use limpid::scene::Scene;

use super::simulation::{LENGTH, Simulation};

/// A simulation, and what draws it.
pub(crate) struct Live {
    gpu: Gpu,
    simulation: Simulation,
    classifier: Classifier,
    renderer: Renderer,
    scene: Scene,
}

impl Live {
    pub(crate) fn new(gpu: &Gpu, count: u32) -> limpid::error::Result<Self> {
        let simulation = Simulation::new(gpu, count);
        let (min, max) = simulation.bounds();
        let (classifier, renderer) = (Classifier::new(gpu)?, Renderer::new(gpu));
        let scene = Look::Daylight.scene(&Body::filling(min, max, simulation.radius()));
        Ok(Self { gpu: gpu.clone(), simulation, classifier, renderer, scene })
    }

    /// Simulates a frame.
    pub(crate) fn step(&self) {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.simulation.record(&mut encoder);
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// Draws the particles where they are.
    pub(crate) fn draw<'a>(
        &mut self,
        target: impl Into<Target<'a>>,
        size: UVec2,
        turn: f64,
    ) -> limpid::error::Result<()> {
        let (min, max) = self.simulation.bounds();
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let splats =
            self.classifier.record(&mut encoder, &self.simulation.particles(), &self.scene)?;
        let middle = 0.5 * (min + max);
        let eye = middle + 1.25 * f64::from(LENGTH) * DVec3::new(turn.sin(), 0.45, turn.cos());
        let seen = DVec3::new(middle.x, 0.3 * max.y, middle.z);
        let camera = Camera { eye, target: seen, fov_y: 40.0, ..Camera::fit(min, max) };
        let input = FrameInput::new(&self.scene, &camera, &splats, size);
        let frame = self.renderer.prepare(input)?;
        self.renderer.record(frame, &mut encoder);
        self.renderer.tonemap(&self.scene.settings.tonemap, &mut encoder, target);
        self.gpu.queue.submit([encoder.finish()]);
        Ok(())
    }
}
