//! From what a user names to frames that can be drawn.

use std::path::Path;

use glam::DVec3;

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::particles::{Particles, Up};
use crate::passes::classify::{self, Splats};
use crate::recipe::Recipe;
use crate::scene::Scene;
use crate::sequence::{Frame, Sequence};

/// A scene with its particle frames.
#[derive(Debug, Clone)]
pub struct Input {
    /// The scene; `None` for bare particle files, which get one from [`Input::settle`].
    pub scene: Option<Scene>,
    /// The frames.
    pub sequence: Sequence,
    /// The frame that the scene names.
    pub frame: Option<i64>,
    radius: Option<f32>,
    up: Up,
    source: Source,
}

/// Where the particles of an input's frames are.
#[derive(Debug, Clone)]
enum Source {
    /// In the files that the frames name.
    Files,
    /// In the program: the demo's.
    Embedded(&'static [u8]),
    /// Nowhere yet.
    Recipe(Recipe),
}

/// A frame of particles, ready to draw.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// Its number.
    pub number: i64,
    /// Number of particles in the file.
    pub particles: usize,
    /// What they are drawn as.
    pub splats: Splats,
    /// Corners of the box around all centres; both 0 without particles.
    pub bounds: (DVec3, DVec3),
}

impl Input {
    /// Opens a scene or a recipe (`.toml`), a particle file, a pattern or a folder.
    ///
    /// # Errors
    /// As [`Scene::load_with`] and [`Sequence::open`]; a scene without particles is an
    /// [`Error::Scene`].
    pub fn open(input: &str, overrides: &[String]) -> Result<Self> {
        let path = Path::new(input);
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
            return Self::from_scene(Scene::load_with(path, overrides)?, input);
        }
        let sequence = Sequence::open(input)?;
        let source = Source::Files;
        Ok(Self { scene: None, sequence, frame: None, radius: None, up: Up::Y, source })
    }

    /// The built-in demo: a frame of a double dam break, simulated with SPlisHSPlasH.
    ///
    /// # Errors
    /// [`Error::Scene`] for a bad override.
    pub fn demo(overrides: &[String]) -> Result<Self> {
        let text = include_str!("../sims/demo.toml");
        let scene = Scene::parse(text, "demo", Path::new(""), overrides)?;
        let source = scene.particles.clone().expect("the demo names its particles");
        let frame = Frame { number: 0, path: source.source.into() };
        Ok(Self {
            scene: Some(scene),
            sequence: Sequence { frames: vec![frame], pattern: "demo".into() },
            frame: Some(0),
            radius: source.radius,
            up: source.up,
            source: Source::Embedded(include_bytes!("../sims/demo.bgeo")),
        })
    }

    /// The same frames in another scene. Where that names particles of its own, their radius and
    /// axis hold for these.
    #[must_use]
    pub fn with_scene(self, scene: Scene) -> Self {
        let (radius, up) = match &scene.particles {
            Some(source) => (source.radius.or(self.radius), source.up),
            None => (self.radius, self.up),
        };
        Self { scene: Some(scene), radius, up, ..self }
    }

    /// The same frames with a particle radius in metres where the files have none.
    ///
    /// # Errors
    /// [`Error::Usage`] unless the radius is above 0 and finite.
    pub fn with_radius(self, radius: f32) -> Result<Self> {
        if radius > 0.0 && radius.is_finite() {
            return Ok(Self { radius: Some(radius), ..self });
        }
        Err(Error::Usage(format!("a particle radius of {radius}: above 0 and finite expected")))
    }

    /// As [`Input::open`], of a scene that is at hand.
    ///
    /// # Errors
    /// As [`Input::open`].
    pub fn from_scene(scene: Scene, origin: &str) -> Result<Self> {
        if let Some(recipe) = scene.recipe {
            let frame = Frame { number: 0, path: origin.into() };
            return Ok(Self {
                scene: Some(scene),
                sequence: Sequence { frames: vec![frame], pattern: origin.into() },
                frame: Some(0),
                radius: Some(recipe.particle_radius() as f32),
                up: Up::Y,
                source: Source::Recipe(recipe),
            });
        }
        let source = scene.particles.clone().ok_or_else(|| Error::Scene {
            origin: origin.into(),
            problem:
                "has no [particles] or [recipe]; give a particle file and this scene with --scene"
                    .into(),
        })?;
        let sequence = Sequence::open(&source.source)?;
        // One file is the frame, whatever digits its name holds.
        let frame = if Path::new(&source.source).is_file() { None } else { source.frame };
        Ok(Self {
            scene: Some(scene),
            sequence,
            frame,
            radius: source.radius,
            up: source.up,
            source: Source::Files,
        })
    }

    /// Reads or makes a frame's particles, y up.
    ///
    /// # Errors
    /// As [`Particles::read`] and [`Recipe::particles`].
    pub fn particles(&self, frame: &Frame) -> Result<Particles> {
        let mut particles = match self.source {
            Source::Files => Particles::read(&frame.path)?,
            Source::Embedded(bytes) => Particles::parse(&frame.path, bytes)?,
            Source::Recipe(recipe) => return recipe.particles(),
        };
        particles.to_y_up(self.up);
        Ok(particles)
    }

    /// Reads and classifies a frame as `scene` says.
    ///
    /// # Errors
    /// As [`Particles::read`]; [`Error::Scene`] if there is no way to know a radius.
    pub fn load(&self, frame: &Frame, scene: &Scene) -> Result<Loaded> {
        self.prepare(frame, &self.particles(frame)?, scene)
    }

    /// Classifies a frame's particles as `scene` says.
    ///
    /// # Errors
    /// [`Error::Scene`] if there is no way to know a radius.
    pub fn prepare(&self, frame: &Frame, particles: &Particles, scene: &Scene) -> Result<Loaded> {
        let settings = &scene.settings.classify;
        let radius = self.radius_of(frame, particles)?;
        let mut splats = classify::classify(particles, radius, settings);
        classify::wet(&mut splats, &scene.solids, settings.wetting);
        Ok(Loaded {
            number: frame.number,
            particles: particles.len(),
            splats,
            bounds: particles.bounds().unwrap_or_default(),
        })
    }

    /// The radius for particles without one of their own: as given, or from their spacing.
    fn radius_of(&self, frame: &Frame, particles: &Particles) -> Result<f32> {
        let radius = self.radius.unwrap_or_else(|| classify::estimate_radius(particles));
        if radius > 0.0 || particles.is_empty() || particles.radii.is_some() {
            return Ok(radius);
        }
        Err(Error::Scene {
            origin: frame.path.display().to_string(),
            problem: "no radii, and no spacing to estimate one from; give --radius".into(),
        })
    }

    /// Settles what neither files nor scene say, by the first frame that has particles: the
    /// radius, and for a scene without a camera the view. Bare files get a scene of their own. So
    /// a sequence has one radius and one view, however it is shared among machines.
    ///
    /// # Errors
    /// As [`Particles::read`]; [`Error::Scene`] for a bad override.
    pub fn settle(mut self, overrides: &[String]) -> Result<(Self, Scene)> {
        let complete = self.scene.as_ref().filter(|scene| scene.camera.is_some());
        if let (Some(scene), Some(_)) = (complete, self.radius) {
            let scene = scene.clone();
            return Ok((self, scene));
        }
        let (mut min, mut max, mut radius) = (-DVec3::ONE, DVec3::ONE, 0.0);
        for frame in &self.sequence.frames {
            let particles = self.particles(frame)?;
            if let Some(bounds) = particles.bounds() {
                (min, max) = bounds;
                radius = self.radius_of(frame, &particles)?;
                break;
            }
        }
        if radius > 0.0 {
            self.radius = Some(radius);
        }
        let mut scene = match self.scene.clone() {
            Some(scene) => scene,
            None => {
                let mut scene = Scene::around(min, max, radius);
                scene.settings = scene.settings.with(overrides)?;
                scene
            }
        };
        let margin = f64::from(radius);
        scene.camera.get_or_insert_with(|| Camera::fit(min - margin, max + margin));
        Ok((self, scene))
    }

    /// Loads `frames` in order on a thread of its own, at most `ahead` of them before they are
    /// taken, and hands each to `draw`.
    ///
    /// # Errors
    /// The first error of loading or of `draw`.
    pub fn for_each_loaded(
        &self,
        frames: &[&Frame],
        scene: &Scene,
        ahead: usize,
        mut draw: impl FnMut(Loaded) -> Result<()>,
    ) -> Result<()> {
        std::thread::scope(|scope| {
            let (sender, receiver) = std::sync::mpsc::sync_channel(ahead);
            scope.spawn(move || {
                for frame in frames {
                    // The receiver is gone once a frame has failed: nothing left to do.
                    if sender.send(self.load(frame, scene)).is_err() {
                        return;
                    }
                }
            });
            receiver.into_iter().try_for_each(|loaded| draw(loaded?))
        })
    }
}

impl Scene {
    /// The scene's camera, or one that fits `bounds`.
    pub fn camera_for(&self, bounds: (DVec3, DVec3)) -> Camera {
        self.camera.unwrap_or_else(|| Camera::fit(bounds.0, bounds.1))
    }
}
