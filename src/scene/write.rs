//! Scenes as files: what [`Scene::load`] reads as the same scene again.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use serde::Serialize;

use super::{Fluid, Light, NamedView, ParticleSource, Scene, Shape, Surface};
use crate::camera::Camera;
use crate::environment::Environment;
use crate::error::{Error, Result};
use crate::output::write_atomically;
use crate::particles::Up;
use crate::recipe::Recipe;
use crate::settings::Settings;
use crate::sim::Simulation;

// The file as it is written: the names that `SceneFile` reads.

#[derive(Serialize)]
struct SceneFile<'a> {
    particles: Option<SourceFile<'a>>,
    fluid: Vec<FluidFile<'a>>,
    recipe: Option<&'a Recipe>,
    simulation: Option<&'a Simulation>,
    liquid: LiquidFile,
    camera: Option<Camera>,
    view: Vec<ViewFile<'a>>,
    environment: EnvironmentFile<'a>,
    solid: Vec<SolidFile>,
    light: Vec<LightFile>,
    settings: &'a Settings,
}

#[derive(Serialize)]
struct SourceFile<'a> {
    source: &'a str,
    frame: Option<i64>,
    radius: Option<f32>,
    up: Up,
    fps: Option<f64>,
}

#[derive(Serialize)]
struct FluidFile<'a> {
    #[serde(flatten)]
    particles: SourceFile<'a>,
    absorption: Vec3,
}

#[derive(Serialize)]
struct LiquidFile {
    ior: f32,
    absorption: Vec3,
}

#[derive(Serialize)]
struct ViewFile<'a> {
    name: &'a str,
    camera: Camera,
}

#[derive(Default, Serialize)]
struct EnvironmentFile<'a> {
    radiance: Option<Vec3>,
    map: Option<&'a str>,
    gradient: Option<GradientFile>,
}

#[derive(Serialize)]
struct GradientFile {
    zenith: Vec3,
    horizon: Vec3,
    nadir: Vec3,
}

#[derive(Default, Serialize)]
struct SolidFile {
    shape: &'static str,
    origin: Option<DVec3>,
    normal: Option<Vec3>,
    half_extent: Option<f32>,
    min: Option<DVec3>,
    max: Option<DVec3>,
    center: Option<DVec3>,
    radius: Option<f32>,
    lit: bool,
    color: Option<Vec3>,
    checker: Option<CheckerFile>,
}

#[derive(Serialize)]
struct CheckerFile {
    tile: f32,
    even: Vec3,
    odd: Vec3,
}

#[derive(Serialize)]
#[serde(rename_all = "lowercase")]
enum LightFile {
    Sun { direction: Vec3, irradiance: Vec3 },
    Point { position: DVec3, intensity: Vec3 },
}

impl Scene {
    /// The scene as the text of a scene file, which [`Scene::parse`] reads as the same scene, to the
    /// last bit. Paths are as the scene has them. An environment map is in a file of its own, which
    /// is given.
    ///
    /// # Errors
    /// [`Error::Usage`] for an environment map without a file.
    pub fn to_toml(&self, map: Option<&str>) -> Result<String> {
        let environment = match (&self.environment, map) {
            (Environment::Constant(radiance), _) => {
                EnvironmentFile { radiance: Some(*radiance), ..Default::default() }
            }
            (&Environment::Gradient { zenith, horizon, nadir }, _) => {
                let gradient = Some(GradientFile { zenith, horizon, nadir });
                EnvironmentFile { gradient, ..Default::default() }
            }
            (Environment::Map { .. }, Some(map)) => {
                EnvironmentFile { map: Some(map), ..Default::default() }
            }
            (Environment::Map { .. }, None) => {
                return Err(Error::Usage("an environment map needs a file of its own".into()));
            }
        };
        // Those that come with the recipe are not written: reading adds them again.
        let own = self.recipe.map_or(0, |recipe| recipe.solids().len());
        let own = self.solids.len().saturating_sub(own);
        let file = SceneFile {
            particles: self.particles.as_ref().map(source),
            fluid: self.fluids.iter().map(fluid).collect(),
            recipe: self.recipe.as_ref(),
            simulation: self.simulation.as_ref(),
            liquid: LiquidFile { ior: self.liquid.ior, absorption: self.liquid.absorption },
            camera: self.camera,
            view: self.views.iter().map(view).collect(),
            environment,
            solid: self.solids[..own].iter().map(solid).collect(),
            light: self.lights.iter().map(light).collect(),
            settings: &self.settings,
        };
        toml::to_string(&file).map_err(|e| Error::Usage(format!("the scene: {e}")))
    }

    /// Writes a scene file that draws alike wherever it lies: particle files in its folder by their
    /// name, others by their whole path, an environment map beside it as `NAME.environment.exr`.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file; nothing is left half-written.
    pub fn save(&self, path: &Path) -> Result<()> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut scene = self.clone();
        let sources = scene.particles.iter_mut();
        for particles in sources.chain(scene.fluids.iter_mut().map(|fluid| &mut fluid.particles)) {
            particles.source = seen_from(folder, &particles.source);
        }
        let map = path.with_extension("environment.exr");
        if let Environment::Map { size, pixels } = &scene.environment {
            let rgb: Vec<f32> = pixels.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
            let picture = image::Rgb32FImage::from_raw(size.x, size.y, rgb);
            let picture = picture.ok_or_else(|| Error::Usage("the map is incomplete".into()))?;
            let mut bytes = std::io::Cursor::new(Vec::new());
            picture
                .write_to(&mut bytes, image::ImageFormat::OpenExr)
                .map_err(|e| Error::io(&map, "write", std::io::Error::other(e)))?;
            write_atomically(&map, |file| file.write_all(bytes.get_ref()))?;
        }
        let name = map.file_name().unwrap_or_default().to_string_lossy();
        let text = scene.to_toml(Some(&name))?;
        write_atomically(path, |file| file.write_all(text.as_bytes()))
    }
}

/// A path that was relative to the working directory, for a file in `folder`.
fn seen_from(folder: &Path, source: &str) -> String {
    let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let here = if folder == Path::new("") { PathBuf::from(".") } else { folder.to_owned() };
    let source = absolute(Path::new(source));
    let seen = source.strip_prefix(absolute(&here)).unwrap_or(&source);
    seen.to_string_lossy().into_owned()
}

fn source(particles: &ParticleSource) -> SourceFile<'_> {
    let ParticleSource { ref source, frame, radius, up, fps } = *particles;
    SourceFile { source, frame, radius, up, fps }
}

fn fluid(fluid: &Fluid) -> FluidFile<'_> {
    FluidFile { particles: source(&fluid.particles), absorption: fluid.absorption }
}

fn view(view: &NamedView) -> ViewFile<'_> {
    ViewFile { name: &view.name, camera: view.camera }
}

fn solid(solid: &super::Solid) -> SolidFile {
    let file = SolidFile { lit: solid.lit, ..Default::default() };
    let file = match solid.shape {
        Shape::Plane { origin, normal, half_extent } => SolidFile {
            shape: "plane",
            origin: Some(origin),
            normal: Some(normal),
            half_extent: half_extent.is_finite().then_some(half_extent),
            ..file
        },
        Shape::Box { min, max } => {
            SolidFile { shape: "box", min: Some(min), max: Some(max), ..file }
        }
        Shape::Sphere { center, radius } => {
            SolidFile { shape: "sphere", center: Some(center), radius: Some(radius), ..file }
        }
    };
    match solid.surface {
        Surface::Color(color) => SolidFile { color: Some(color), ..file },
        Surface::Checker { tile, even, odd } => {
            SolidFile { checker: Some(CheckerFile { tile, even, odd }), ..file }
        }
    }
}

fn light(light: &Light) -> LightFile {
    match *light {
        Light::Sun { direction, irradiance } => LightFile::Sun { direction, irradiance },
        Light::Point { position, intensity } => LightFile::Point { position, intensity },
    }
}
