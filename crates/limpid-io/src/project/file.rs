//! Scene files: parsing and validation of their TOML, and writing that reads back as the same project.

use std::ffi::OsStr;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::de::{DeTable, DeValue, ValueDeserializer};

use super::bodies::{Bodies, BodiesFile};
use super::diffuse::{self, DiffuseSource};
use super::lengths;
use super::motion::SolidMotion;
use super::sections::{
    BackgroundFile, EnvironmentFile, FluidFile, Inside, LiquidFile, LoadMap, SettingsFile,
    opaque_colors,
};
use super::solids::{Given, SolidFile, SolidFiles};
use super::{Automatic, LiquidSource, NamedView, ParticleSource, Project};
use crate::budget::Budget;
use crate::camera_axes::CameraAxes;
use crate::environment;
use crate::error::{Error, Result, toml_error};
use crate::files;
use crate::floor::{Floor, is_ground};
use crate::output::{FileKind, write_atomically};
use crate::shared_classifier::Processor;
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::liquid::Up;
use limpid::liquid::particles::drawable;
use limpid::look::Look;
use limpid::scene::{Light, Liquid, Scene, Solid};
use limpid_sim::recipe::Recipe;
use limpid_sim::sim::Simulation;

// The file's structure; `Project` is the validated form.

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneFile {
    #[serde(skip_serializing_if = "Option::is_none")]
    look: Option<Look>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sky: Option<Look>,
    #[serde(skip_serializing_if = "Option::is_none")]
    floor: Option<toml::Value>,
    particles: Option<ParticleSource>,
    #[serde(default)]
    fluid: Vec<FluidFile>,
    recipe: Option<Recipe>,
    simulation: Option<Simulation>,
    diffuse: Option<Vec<DiffuseSource>>,
    #[serde(default)]
    liquid: LiquidFile,
    camera: Option<Camera>,
    #[serde(default)]
    view: Vec<NamedView>,
    environment: Option<EnvironmentFile>,
    background: Option<BackgroundFile>,
    #[serde(default)]
    solid: Vec<SolidFile>,
    rigid_bodies: Option<BodiesFile>,
    #[serde(default)]
    light: Vec<Light>,
    #[serde(default)]
    settings: SettingsFile,
}

impl Project {
    /// Reads a scene file. Its paths are relative to its folder.
    ///
    /// # Errors
    /// [`Error::Io`], or [`Error::Scene`] naming the line, the key and, for an unknown one, the nearest
    /// known one.
    pub fn load(path: &Path) -> Result<Self> {
        Self::read(path, environment::load)
    }

    /// As [`Project::load`], but reads only the size of an environment map.
    ///
    /// # Errors
    /// As [`Project::load`].
    pub(crate) fn outline(path: &Path) -> Result<Self> {
        Self::read(path, environment::outline)
    }

    fn read(path: &Path, load_map: LoadMap) -> Result<Self> {
        let text = files::read_text(path)?;
        let folder = path.parent().unwrap_or(Path::new("."));
        Self::parse_with(&text, &path.display().to_string(), folder, load_map, Given::default())
    }

    /// Parses a scene file's text. `origin` names it in errors; paths are relative to `folder`.
    ///
    /// # Errors
    /// As [`Project::load`].
    pub fn parse(text: &str, origin: &str, folder: &Path) -> Result<Self> {
        Self::parse_given(text, origin, folder, Given::default())
    }

    /// As [`Project::parse`], where some data that the text names are in memory instead of files.
    ///
    /// # Errors
    /// As [`Project::load`].
    pub fn parse_given(text: &str, origin: &str, folder: &Path, given: Given) -> Result<Self> {
        Self::parse_with(text, origin, folder, environment::load, given)
    }

    fn parse_with(
        text: &str,
        origin: &str,
        folder: &Path,
        load_map: LoadMap,
        given: Given,
    ) -> Result<Self> {
        let at_line = |e: toml::de::Error| toml_error(text, origin, &e);
        let fail = |problem: String| Error::Scene { origin: origin.to_owned(), problem };
        let mut table = DeTable::parse(text).map_err(at_line)?;
        let processor = take_processor(table.get_mut()).map_err(at_line)?;
        let (camera_axes, view_axes) = take_camera_axes(table.get_mut()).map_err(at_line)?;
        // Which keys were given: the structs cannot tell.
        let given_keys = toml::Table::deserialize(toml::Deserializer::from(table.clone()));
        let given_keys = given_keys.map_err(at_line)?;
        let mut file = SceneFile::deserialize(toml::Deserializer::from(table)).map_err(at_line)?;
        let camera_axes = camera_axes.of(file.camera.as_ref());
        for (view, axes) in file.view.iter_mut().zip(view_axes) {
            view.axes = axes.of(Some(&view.camera));
        }
        lengths::check::<SceneFile>(&given_keys).map_err(fail)?;
        let mut automatic = automatic(&file, &given_keys);
        let floor = file.floor.as_ref().map(floor).transpose().map_err(fail)?;
        if file.sky.is_some() && file.environment.is_some() {
            return Err(fail(
                "takes one of [environment] and sky, the look whose sky it is".into(),
            ));
        }
        let mut solid_files = SolidFiles::with(given);
        let budget = Budget::of_meshes();
        let (given, bodies) = (std::mem::take(&mut file.solid), file.rigid_bodies.as_ref());
        let loaded = load_solids(given, bodies, folder, &mut solid_files, &budget, &fail)?;
        let (mut solids, motion) = loaded;
        if file.simulation.is_some() && !motion.is_empty() {
            let problem = "[simulation] takes solids that stand still: bake without [[solid.key]], meshes of \
                several frames and [rigid_bodies], and draw the baked frames as [particles] of a scene with them";
            return Err(fail(problem.into()));
        }
        let sources = [
            file.particles.is_some(),
            file.recipe.is_some(),
            file.simulation.is_some(),
            !file.fluid.is_empty(),
        ];
        if sources.into_iter().filter(|&given| given).count() > 1 {
            let problem = "takes one of [particles], [[fluid]], [recipe] and [simulation]";
            return Err(fail(problem.into()));
        }
        if let Some(recipe) = &file.recipe {
            recipe.check().map_err(|e| in_file(e.into(), &fail))?;
            solids.extend(recipe.solids());
        }
        if let Some(automatic) = &mut automatic {
            automatic.ground = match floor {
                Some(floor) => floor != Floor::None,
                None => !solids.iter().any(is_ground),
            };
            automatic.height = floor.and_then(Floor::height);
        } else if floor.is_some_and(|floor| floor != Floor::None) {
            let problem = "floor is the height of a look's ground, and a scene with an [environment] is complete: add \
                           a plane as [[solid]], or a look";
            return Err(fail(problem.into()));
        }
        let tint_thickness = file.liquid.tint_thickness;
        if tint_thickness.is_some_and(|length| !(length > 0.0 && length.is_finite())) {
            return Err(fail("[liquid] tint_thickness must be above 0 m".into()));
        }
        let color_by = file.liquid.color_by().map_err(|e| fail(format!("[liquid] {e}")))?;
        let liquid = file.liquid.validated().map_err(|e| fail(format!("[liquid] {e}")))?;
        let diffuse = file.diffuse.map(|all| diffuse::validated(all, folder, &fail)).transpose()?;
        let fluids = std::mem::take(&mut file.fluid);
        let alone = (file.particles, file.recipe, file.simulation);
        let (source, media) = liquid_source(alone, fluids, &liquid, folder, &fail)?;
        let opaque_fluids = opaque_colors(&media, &liquid).map_err(&fail)?;
        let fluids = media.into_iter().map(|inside| inside.medium(&liquid)).collect();
        let given = &solid_files.given().environments;
        let environment =
            file.environment.unwrap_or_default().validated(folder, load_map, given, &fail)?;
        let background = file.background.map(|background| folder.join(background.file));
        let background = background.map(|file| solid_files.texture(&file, &budget)).transpose()?;
        solid_files.complete();
        let settings = file.settings.validated(&given_keys).map_err(at_line)?;
        let lights = file.light;
        let project = Self {
            scene: Scene { liquid, fluids, environment, background, solids, lights, settings },
            solid_files,
            motion,
            source,
            diffuse,
            camera: file.camera,
            camera_axes,
            views: file.view,
            processor,
            color_by,
            tint_thickness,
            opaque_fluids,
            automatic,
        };
        project.check().map_err(|e| in_file(e, &fail))?;
        Ok(project)
    }

    /// Writes the text of a scene file, which [`Project::parse`] reads back as the same project,
    /// bit-exactly; parts that a look provides are left out. Paths are written as the project has them;
    /// `map` is the file of an environment map.
    ///
    /// # Errors
    /// [`Error::Usage`] for an environment map without a file.
    pub fn to_toml(&self, map: Option<&str>) -> Result<String> {
        let Self {
            scene, solid_files, motion, source, camera, views, processor, automatic, ..
        } = self;
        let provides = |part: fn(&Automatic) -> bool| automatic.as_ref().is_some_and(part);
        let environment = match provides(|automatic| automatic.environment) {
            true => None,
            false => Some(EnvironmentFile::of(&scene.environment, map)?),
        };
        let background = scene.background.as_ref().map(|texture| {
            let problem = || Error::Usage("a background needs a file of its own".into());
            solid_files.texture_source(texture).ok_or_else(problem)
        });
        let background = background.transpose()?;
        let mut liquid = LiquidFile::of(&scene.liquid, self.color_by.as_ref());
        liquid.absorption =
            liquid.absorption.filter(|_| !provides(|automatic| automatic.absorption));
        if let Some(name) = automatic.and_then(|automatic| automatic.medium) {
            liquid = LiquidFile { ior: liquid.ior, ..LiquidFile::named(name) };
        }
        liquid.tint_thickness = self.tint_thickness;
        let solids = scene.solids[..self.own_solids()].iter().enumerate();
        let solids = solids.map(|(i, solid)| SolidFile::of(solid, motion.of(i), solid_files));
        let (mut particles, mut fluid) = (None, Vec::new());
        match source {
            LiquidSource::File(file) => particles = Some(file.clone()),
            LiquidSource::Fluids(files) => {
                let fluids = files.iter().zip(&scene.fluids).enumerate();
                fluid.extend(fluids.map(|(i, (source, &medium))| {
                    let color = self.opaque_fluids.get(i).copied().flatten();
                    FluidFile::of(source, color.map_or(Inside::Medium(medium), Inside::Opaque))
                }));
            }
            _ => {}
        }
        let file = SceneFile {
            look: automatic.map(|automatic| automatic.look),
            sky: automatic.filter(|automatic| automatic.environment).and_then(|own| own.sky),
            floor: automatic.and_then(|automatic| automatic.floor(scene)),
            particles,
            fluid,
            recipe: source.recipe().copied(),
            simulation: source.simulation().cloned(),
            diffuse: self.diffuse.clone(),
            liquid,
            camera: *camera,
            view: views.clone(),
            environment,
            background: background.map(|file| BackgroundFile { file: file.to_owned() }),
            solid: solids.collect::<Result<_>>()?,
            rigid_bodies: motion.bodies().map(|bodies| bodies.file().clone()),
            light: scene.lights.clone(),
            settings: SettingsFile::of(&scene.settings),
        };
        let fail = |e: &dyn std::fmt::Display| Error::Usage(format!("the scene: {e}"));
        // By its text, which has the fewest digits of 32-bit floats; a table has 64-bit ones.
        let text = toml::to_string(&file).map_err(|e| fail(&e))?;
        let mut file: toml::Table = text.parse().map_err(|e| fail(&e))?;
        if *processor != Processor::default() {
            put_processor(&mut file, *processor);
        }
        if let Some(camera) = camera {
            put_camera_axes(file.get_mut("camera"), self.camera_axes, camera);
        }
        let tables = file.get_mut("view").and_then(toml::Value::as_array_mut);
        for (table, view) in tables.into_iter().flatten().zip(views) {
            put_camera_axes(table.get_mut("camera"), view.axes, &view.camera);
        }
        if let Some(settings) = file.get_mut("settings").and_then(toml::Value::as_table_mut) {
            if provides(|automatic| automatic.caustics) {
                settings.remove("caustics");
            }
            if provides(|automatic| automatic.tonemap) {
                settings.remove("tonemap");
            }
            let refract = settings.get_mut("refract").and_then(toml::Value::as_table_mut);
            if let Some(refract) = refract.filter(|_| provides(|automatic| automatic.patterns)) {
                refract.remove("filter_patterns");
            }
        }
        toml::to_string(&file).map_err(|e| fail(&e))
    }

    /// Writes a scene file that is valid in any folder: particle files below its folder by their
    /// relative path, others by their absolute path; beside it an environment map as
    /// `NAME.environment.exr`, and meshes and textures that no file holds as `NAME.mesh-1.ply` and `NAME.texture-1.png`.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file; no unfinished file is left.
    pub fn save(&self, path: &Path) -> Result<()> {
        // Checked before the map is written.
        FILE_KIND.check(path)?;
        for (path, bytes) in self.to_files(path)? {
            let kind = match path.extension().and_then(OsStr::to_str) {
                Some("exr" | "png") => FileKind::PICTURE,
                Some("ply") => FileKind::MESH,
                _ => FILE_KIND,
            };
            write_atomically(&path, kind, |file| file.write_all(&bytes))?;
        }
        Ok(())
    }

    /// The files that [`Project::save`] writes, with their paths, the scene file last.
    ///
    /// # Errors
    /// As [`Project::save`].
    pub fn to_files(&self, path: &Path) -> Result<Vec<(PathBuf, Vec<u8>)>> {
        let folder = path.parent().unwrap_or(Path::new(""));
        let mut project = self.clone();
        let mut files = project.solid_files.name_given(path)?;
        for particles in project.source.files_mut() {
            particles.source = relative_to(folder, &particles.source);
        }
        for diffuse in project.diffuse.iter_mut().flatten() {
            diffuse.source = relative_to(folder, &diffuse.source);
        }
        let relative = |path: &Path| relative_to(folder, path);
        project.solid_files.map_paths(relative);
        project.motion.map_paths(relative);
        let map = path.with_extension("environment.exr");
        if let Environment::Map { size, pixels } = &project.scene.environment {
            let rgb: Vec<f32> = pixels.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
            let picture = image::Rgb32FImage::from_raw(size.x, size.y, rgb);
            let picture = picture.ok_or_else(|| Error::Usage("the map is incomplete".into()))?;
            let mut bytes = std::io::Cursor::new(Vec::new());
            picture
                .write_to(&mut bytes, image::ImageFormat::OpenExr)
                .map_err(|e| Error::io(&map, "write", std::io::Error::other(e)))?;
            files.push((map.clone(), bytes.into_inner()));
        }
        let name = map.file_name().unwrap_or_default().to_string_lossy();
        files.push((path.to_owned(), project.to_toml(Some(&name))?.into_bytes()));
        Ok(files)
    }
}

/// The kind of scene files.
pub const FILE_KIND: FileKind =
    FileKind::new("a scene", |file| files::read_text(file.path).is_ok_and(|text| is_scene(&text)));

/// The solids of a file, and how they move.
fn load_solids(
    given: Vec<SolidFile>,
    bodies: Option<&BodiesFile>,
    folder: &Path,
    files: &mut SolidFiles,
    budget: &Budget,
    fail: &dyn Fn(String) -> Error,
) -> Result<(Vec<Solid>, SolidMotion)> {
    let (mut solids, mut motion) = (Vec::new(), SolidMotion::default());
    for (number, solid) in (1..).zip(given) {
        let fail = |problem: String| fail(format!("[[solid]] {number}: {problem}"));
        let (solid, moves) = solid.load(folder, files, budget, &fail)?;
        motion.push(solids.len(), moves);
        solids.push(solid);
    }
    if let Some(bodies) = bodies {
        let (bodies, shown) = Bodies::open(bodies, folder, &mut files.remarks, budget)?;
        motion.set_bodies(solids.len(), bodies);
        solids.extend(shown);
    }
    Ok((solids, motion))
}

/// Where a file's liquid comes from, one of the first three or `fluids`, and what is inside these.
fn liquid_source(
    alone: (Option<ParticleSource>, Option<Recipe>, Option<Simulation>),
    fluids: Vec<FluidFile>,
    liquid: &Liquid,
    folder: &Path,
    fail: &dyn Fn(String) -> Error,
) -> Result<(LiquidSource, Vec<Inside>)> {
    let (mut sources, mut media) = (Vec::new(), Vec::new());
    for (number, fluid) in (1..).zip(fluids) {
        let fluid = fluid.validated(liquid.medium());
        let (source, medium) = fluid.map_err(|e| fail(format!("[[fluid]] {number}: {e}")))?;
        sources.push(source);
        media.push(medium);
    }
    let mut source = match alone {
        (Some(particles), ..) => LiquidSource::File(particles),
        (_, Some(recipe), _) => LiquidSource::Recipe(recipe),
        (.., Some(simulation)) => LiquidSource::Simulation(simulation),
        _ if !sources.is_empty() => LiquidSource::Fluids(sources),
        _ => LiquidSource::Unspecified,
    };
    let single = matches!(source, LiquidSource::File(_));
    for (number, p) in (1..).zip(source.files_mut()) {
        let table = if single { "[particles]".to_owned() } else { format!("[[fluid]] {number}:") };
        if let Some(radius) = p.radius.filter(|&radius| !drawable(radius)) {
            let problem = format!("{table} radius is {radius:?}, expected 1e-12 to 1e12 m");
            return Err(fail(problem));
        }
        if p.fps.is_some_and(|fps| !(fps > 0.0 && fps.is_finite())) {
            return Err(fail(format!("{table} fps must be above 0")));
        }
        if p.scale.is_some_and(|scale| !is_scale(scale)) {
            return Err(fail(format!("{table} scale must be 1e-12 to 1e12")));
        }
        if !p.source.as_os_str().is_empty() {
            p.source = folder.join(&p.source);
        }
    }
    Ok((source, media))
}

/// Whether a text is a scene file, independent of the files that it refers to.
fn is_scene(text: &str) -> bool {
    let Ok(mut table) = DeTable::parse(text) else { return false };
    take_processor(table.get_mut()).is_ok()
        && take_camera_axes(table.get_mut()).is_ok()
        && SceneFile::deserialize(toml::Deserializer::from(table)).is_ok()
}

/// The parts of the scene that a look provides. Without `look`, a scene with an environment is complete.
fn automatic(file: &SceneFile, table: &toml::Table) -> Option<Automatic> {
    if file.look.is_none() && file.environment.is_some() {
        return None;
    }
    let settings = table.get("settings").and_then(toml::Value::as_table);
    let lacks = |pass: &str| settings.is_none_or(|settings| !settings.contains_key(pass));
    let patterns = settings.and_then(|settings| settings.get("refract")?.get("filter_patterns"));
    Some(Automatic {
        look: file.look.unwrap_or_default(),
        environment: file.environment.is_none(),
        sky: file.sky,
        // Known with the solids.
        ground: true,
        height: None,
        light: file.light.is_empty(),
        absorption: file.liquid.provides_no_medium(),
        medium: file.liquid.medium_alone(),
        caustics: lacks("caustics"),
        tonemap: lacks("tonemap"),
        patterns: patterns.is_none(),
    })
}

/// The `floor` of a file.
fn floor(value: &toml::Value) -> Result<Floor, String> {
    let height = value.as_float().or_else(|| value.as_integer().map(|y| y as f64));
    let text =
        height.map_or_else(|| value.as_str().unwrap_or_default().to_owned(), |y| y.to_string());
    text.parse().map_err(|problem| format!("floor is {value}: {problem}"))
}

impl Automatic {
    /// The `floor` of a file with this scene, if it needs one.
    fn floor(&self, scene: &Scene) -> Option<toml::Value> {
        match (self.ground, self.height) {
            (true, height) => height.map(toml::Value::Float),
            (false, _) if scene.solids.iter().any(is_ground) => None,
            (false, _) => Some("none".into()),
        }
    }
}

/// Whether a unit's length, m, keeps ordinary positions within the range of 32-bit floats.
pub(crate) fn is_scale(scale: f64) -> bool {
    (1e-12..=1e12).contains(&scale)
}

/// Removes `classify.on` from the file's `[settings]`, since it selects a processor and does not change
/// the picture.
fn take_processor(file: &mut DeTable<'_>) -> Result<Processor, toml::de::Error> {
    let classify = table(file, "settings").and_then(|settings| table(settings, "classify"));
    match classify.and_then(|classify| classify.remove("on")) {
        Some(value) => Processor::deserialize(ValueDeserializer::from(value)),
        None => Ok(Processor::default()),
    }
}

/// A table in a table.
fn table<'a, 'i>(of: &'a mut DeTable<'i>, name: &str) -> Option<&'a mut DeTable<'i>> {
    if let DeValue::Table(table) = of.get_mut(name)?.get_mut() { Some(table) } else { None }
}

/// Axes in a camera's table.
#[derive(Default)]
struct AxesFile {
    up_axis: Option<Up>,
    has_up: bool,
}

impl AxesFile {
    /// Removes `up_axis`, which no other camera has.
    fn take(camera: &mut DeTable<'_>) -> Result<Self, toml::de::Error> {
        let up_axis = camera.remove("up_axis");
        let up_axis = up_axis.map(|value| Up::deserialize(ValueDeserializer::from(value)));
        let has_up = ["up", "pose"].into_iter().any(|key| camera.contains_key(key));
        Ok(Self { up_axis: up_axis.transpose()?, has_up })
    }

    fn of(&self, camera: Option<&Camera>) -> CameraAxes {
        let up = camera.filter(|_| self.has_up).map(|camera| camera.up);
        camera.map_or(CameraAxes::default(), |_| CameraAxes::in_file(self.up_axis, up))
    }
}

/// Removes the axes of `[camera]` and of each `[[view]]`.
fn take_camera_axes(file: &mut DeTable<'_>) -> Result<(AxesFile, Vec<AxesFile>), toml::de::Error> {
    let camera = table(file, "camera").map_or(Ok(AxesFile::default()), AxesFile::take)?;
    let views = match file.get_mut("view").map(|views| views.get_mut()) {
        Some(DeValue::Array(views)) => {
            let of_view = |view: &mut DeValue<'_>| match view {
                DeValue::Table(view) => {
                    table(view, "camera").map_or(Ok(AxesFile::default()), AxesFile::take)
                }
                _ => Ok(AxesFile::default()),
            };
            views.iter_mut().map(|view| of_view(view.get_mut())).collect::<Result<_, _>>()?
        }
        _ => Vec::new(),
    };
    Ok((camera, views))
}

/// Adds to a camera's table the axes that [`take_camera_axes`] takes from it.
fn put_camera_axes(table: Option<&mut toml::Value>, axes: CameraAxes, camera: &Camera) {
    let Some(table) = table.and_then(toml::Value::as_table_mut) else { return };
    if axes.is_level {
        table.remove("up");
    }
    if let Some(up) = axes.up_axis(camera.up) {
        table.insert("up_axis".into(), up.to_string().into());
    }
}

/// Adds `classify.on`, which [`take_processor`] removes.
fn put_processor(file: &mut toml::Table, processor: Processor) {
    let classify = ["settings", "classify"].into_iter().fold(file, |table, name| {
        let inner = table.entry(name).or_insert_with(|| toml::Table::new().into());
        inner.as_table_mut().expect("the file has these tables")
    });
    let on = toml::Value::try_from(processor).expect("a processor is a word");
    classify.insert("on".into(), on);
}

/// Adds the file's name to an error of a part of the file.
fn in_file(error: Error, fail: &dyn Fn(String) -> Error) -> Error {
    match error {
        Error::Render(limpid::Error::Invalid { part, problem }) => {
            fail(format!("[{part}] {problem}"))
        }
        other => other,
    }
}

/// Converts a path relative to the working directory to one relative to `folder`, or to an absolute path
/// if it is outside.
fn relative_to(folder: &Path, source: &Path) -> PathBuf {
    let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let here = if folder == Path::new("") { PathBuf::from(".") } else { folder.to_owned() };
    let source = absolute(source);
    source.strip_prefix(absolute(&here)).unwrap_or(&source).to_owned()
}
