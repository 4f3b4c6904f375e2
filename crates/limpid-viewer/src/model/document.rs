//! The open document: an input that is ready to be loaded, and its scene.

use std::path::{Path, PathBuf};

use glam::UVec2;
use serde::{Deserialize, Serialize};

use crate::model::platform::IN_BROWSER;
use crate::model::playback::Speed;
use crate::model::reading::Reading;
use limpid::camera::Camera;
use limpid::liquid::Up;
use limpid::look::Framing;
use limpid::scene::{Scene, Shape};
use limpid_io::adjustments::Adjustments;
use limpid_io::bake;
use limpid_io::color_by::{ColorBy, ColorScale};
use limpid_io::error::Result;
use limpid_io::frames::FrameSpec;
use limpid_io::input::{FrameTime, Loaded, Loader, Missing, files_of};
use limpid_io::notice::{self, Notice};
use limpid_io::open::{Opened, Request};
use limpid_io::output::{FileKind, Files};
use limpid_io::particles::{AttributeMap, ReadOptions, Selection, readable_stem};
use limpid_io::project;
use limpid_io::project::{LiquidSource, ParticleSource, Project};
use limpid_io::sequence::Sequence;
use limpid_io::shared_classifier::Processor;

/// The view of a scene in windows that are taller than wide.
const TALL: &str = "tall";

/// A source to open, as on the command line.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Source {
    /// A scene, a recipe, a particle file, a pattern or a folder.
    pub input: String,
    /// The scene in which its particles are drawn.
    pub scene: Option<PathBuf>,
    /// Particle radius for files that have none, m.
    pub radius: Option<f32>,
    /// Overridden settings, as for `--set`.
    pub overrides: Vec<String>,
    /// The frames; all if absent.
    pub frames: Option<FrameSpec>,
    /// How missing frames are replaced.
    pub missing: Missing,
    /// How particle files are read.
    #[serde(skip)]
    pub options: ReadOptions,
    /// Changes to the scene and to the reading of its files.
    pub adjustments: Adjustments,
    /// The picture that an automatic camera is for.
    pub framing: Framing,
}

/// An open document.
#[derive(Debug, Clone)]
pub struct Document {
    /// The source that it was opened from.
    pub source: Source,
    /// The source of the particles.
    pub input: Loader,
    /// The scene as `limpid render` draws it without further arguments.
    pub plain: Scene,
    /// The processor that classifies the particles there.
    pub plain_processor: Processor,
    /// The attribute that colours the particles there.
    pub plain_color_by: Option<ColorBy>,
    /// The project with the overrides of the command line.
    pub project: Project,
    /// The values that its particles' colours show; `None` if no map shows an attribute.
    pub scale: Option<ColorScale>,
    /// Length of liquid that light typically crosses, m, if it was measured.
    pub thickness: Option<f32>,
    /// How its files are read.
    pub reading: Reading,
    /// Frame numbers, ascending; at least one.
    pub numbers: Vec<i64>,
    /// Identifies it between a page and its worker; 0 elsewhere.
    pub id: u64,
}

impl Source {
    /// A source without options.
    pub fn new(input: impl Into<String>) -> Self {
        Self { input: input.into(), ..Self::default() }
    }

    /// The source of files that were dropped together, and the number of those that do not belong to it: the scene, the
    /// only file, or the sequence with the most files. `None` without files.
    pub fn of_files(paths: &[PathBuf]) -> Option<(Self, usize)> {
        let is_scene =
            |path: &&PathBuf| path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
        let text = |path: &Path| path.to_string_lossy().into_owned();
        if let Some(alone) =
            paths.iter().find(is_scene).or(paths.first().filter(|_| paths.len() == 1))
        {
            return Some((Self::new(text(alone)), paths.len() - 1));
        }
        let mut sequences = std::collections::BTreeMap::<PathBuf, Vec<i64>>::new();
        for path in paths {
            if let Ok((pattern, numbers)) = Sequence::pattern_of(std::slice::from_ref(path)) {
                sequences.entry(pattern).or_default().extend(numbers);
            }
        }
        let longest = sequences.into_iter().max_by_key(|(_, numbers)| numbers.len());
        let Some((pattern, mut numbers)) = longest else {
            return Some((Self::new(text(paths.first()?)), paths.len() - 1));
        };
        numbers.sort_unstable();
        let left_out = paths.len() - numbers.len();
        let frames = Some(FrameSpec::list(numbers));
        Some((Self { input: text(&pattern), frames, ..Self::default() }, left_out))
    }
}

impl Document {
    /// Opens a source. This may read the first frame, and for the usual range of an attribute that colours the particles
    /// some of all frames.
    ///
    /// # Errors
    /// As [`Request::open`] and [`Loader::color_scale`].
    pub fn open(source: &Source) -> Result<Self> {
        let request = Request {
            input: Some(source.input.clone().into()),
            scene: source.scene.clone(),
            radius: source.radius,
            overrides: source.overrides.clone(),
            camera: None,
            camera_up: None,
            missing: source.missing,
            options: source.options.clone(),
            adjustments: source.adjustments.clone(),
            framing: source.framing,
            ..Request::default()
        };
        let Opened { loader: input, plain, mut project, .. } = request.open()?;
        let tall = project.views.iter().find(|view| view.name == TALL);
        if let Some(view) = tall.filter(|_| source.framing.aspect < 1.0) {
            project.camera = Some(view.camera);
        }
        let spec = source.frames.clone().unwrap_or_default();
        let mut numbers = spec.numbers(&input.sequence, input.missing)?;
        numbers.sort_unstable();
        Ok(Self {
            source: source.clone(),
            plain: plain.scene,
            plain_processor: plain.processor,
            plain_color_by: plain.color_by,
            project,
            scale: input.color_scale()?,
            thickness: input.body().map(|body| body.thickness() as f32),
            reading: Reading::of(&input),
            input,
            numbers,
            id: 0,
        })
    }

    /// Whether it is particles without a scene.
    pub(crate) fn is_bare(&self) -> bool {
        self.source.scene.is_none() && !self.source.input.to_lowercase().ends_with(".toml")
    }

    /// The usual range of the values that colour the particles, if it is known.
    pub(crate) fn usual_range(&self) -> Option<[f32; 2]> {
        self.scale.as_ref().filter(|scale| scale.automatic).map(|scale| scale.range)
    }

    /// Whether its frames are those of another document of the same file, whatever else differs: look, sky, sun, and the
    /// liquid's optics. Settings of classification are compared elsewhere.
    pub(crate) fn has_frames_of(&self, other: &Self) -> bool {
        let reading = |document: &Self| {
            let mut source = document.source.clone();
            let adjusted = &mut source.adjustments;
            (adjusted.look, adjusted.sky, adjusted.sun, adjusted.floor) = Default::default();
            (adjusted.ior, adjusted.tint) = Default::default();
            source
        };
        let shapes = |document: &Self| -> Vec<Shape> {
            document.project.scene.solids.iter().map(|solid| solid.shape.clone()).collect()
        };
        reading(self) == reading(other)
            && (&self.numbers, &self.project.color_by) == (&other.numbers, &other.project.color_by)
            && shapes(self) == shapes(other)
    }

    /// The frame times of playback at a speed.
    pub fn frame_times(&self, speed: Speed) -> Vec<FrameTime> {
        self.input.frame_times(&self.numbers, speed.step())
    }

    /// Seconds from the first frame to a frame time.
    pub fn seconds(&self, at: FrameTime) -> f64 {
        let first = self.numbers.first().copied().unwrap_or(at.frame);
        let part = at.fraction * at.next.abs_diff(at.frame) as f64;
        let since = at.frame.abs_diff(first) as f64 + part;
        since / (self.input.sequence.stride() as f64 * self.fps())
    }

    /// Index of the frame time nearest to a time, s; 0 if there are none.
    pub fn nearest(&self, frame_times: &[FrameTime], seconds: f64) -> usize {
        let distance = |at: usize| (self.seconds(frame_times[at]) - seconds).abs();
        (0..frame_times.len())
            .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
            .unwrap_or_default()
    }

    /// Frames per second.
    pub fn fps(&self) -> f64 {
        self.input.fps().unwrap_or(30.0)
    }

    /// The notices on its first frame, loaded for `scene`.
    pub(crate) fn notices(&self, loaded: &Loaded, scene: &Scene) -> Vec<Notice> {
        let mut notices = notice::of_frame(loaded, scene);
        notices.extend(notice::of_scene(scene));
        notices.extend(notice::of_sequence(&self.input));
        let incomplete = self.project.solid_files.remarks.iter().cloned();
        notices.extend(incomplete.map(Notice::Incomplete));
        notices
    }

    /// A short name for titles.
    pub fn name(&self) -> &str {
        short_name(&self.source.input)
    }

    /// Fails if saving to `path` would overwrite the document's file, its environment map or its
    /// particles, or a file of another kind.
    ///
    /// # Errors
    /// As [`Files::writes`].
    pub fn check_output(&self, path: &Path, kind: FileKind) -> Result<()> {
        let mut files = Files::default();
        let input = PathBuf::from(&self.source.input);
        for input in [Some(&input), self.source.scene.as_ref()].into_iter().flatten() {
            files_of(input).iter().for_each(|path| files.reads(path));
        }
        files.writes(path, kind)
    }

    /// As [`Document::check_output`], for a scene and the environment map beside it.
    ///
    /// # Errors
    /// As [`Files::writes`].
    pub fn check_scene_output(&self, path: &Path) -> Result<()> {
        self.check_output(&path.with_extension("environment.exr"), FileKind::PICTURE)?;
        self.check_output(path, project::FILE_KIND)
    }

    /// The project to save for a scene, with the particles that are drawn, whatever their source.
    pub fn saved(&self, scene: Scene, camera: Camera, at: FrameTime) -> Project {
        let camera = Some(camera);
        let mut project = Project { scene, camera, ..self.project.clone() };
        // In a browser the frames are in memory alone, and are simulated again.
        if let LiquidSource::Simulation(simulation) = &project.source
            && !IN_BROWSER
        {
            // The frames are stored beside the opened file, not beside the saved one.
            let opened = Path::new(&self.source.input);
            let name = opened.file_stem().unwrap_or_default().to_string_lossy();
            project.source = LiquidSource::File(ParticleSource {
                source: bake::frame_pattern(&bake::folder(opened), &name).into(),
                frame: None,
                radius: Some(simulation.particle_radius() as f32),
                up: Some(Up::Y),
                fps: Some(simulation.fps),
                scale: None,
                map: AttributeMap::default(),
                select: Selection::default(),
            });
        }
        let unnamed = match &project.source {
            LiquidSource::Unspecified => Some(ParticleSource::default()),
            LiquidSource::File(file) if self.source.scene.is_some() => Some(file.clone()),
            _ => None,
        };
        if let Some(ParticleSource { radius, up, fps, scale, map, select, .. }) = unnamed {
            project.source = LiquidSource::File(ParticleSource {
                source: self.source.input.clone().into(),
                frame: None,
                radius: self.source.radius.or(radius),
                up,
                fps,
                scale,
                map,
                select,
            });
        }
        let adjusted = &self.source.adjustments;
        for particles in project.source.files_mut() {
            particles.frame = (self.numbers.len() > 1).then_some(at.frame);
            particles.radius = self.source.radius.or(particles.radius);
            particles.up = Some(self.reading.up);
            particles.scale = adjusted.scale.or(particles.scale);
            particles.fps = adjusted.fps.or(particles.fps);
            if !self.source.options.map.is_empty() {
                particles.map.clone_from(&self.source.options.map);
            }
            if !self.source.options.select.is_automatic() {
                particles.select.clone_from(&self.source.options.select);
            }
        }
        project
    }
}

/// The framing of an automatic camera in a window of this size: wider windows show more at both sides.
pub(crate) fn framing_of(size: UVec2) -> Framing {
    let is_narrow = size.min_element() > 0 && Framing::of(size).aspect < Framing::default().aspect;
    if is_narrow { Framing::of(size) } else { Framing::default() }
}

/// The last part of the path of an input.
pub(crate) fn short_name(input: &str) -> &str {
    let query = if IN_BROWSER { input.find('?') } else { None };
    let input = query.map_or(input, |query| &input[..query]);
    let input = input.trim_end_matches('/');
    input.rsplit('/').next().unwrap_or(input)
}

/// Chooses the path to open among files that were dropped or chosen together: the scene, the only file, or the folder
/// with the most particle files.
pub fn opened_of(paths: &[&str]) -> Option<String> {
    let depth = |path: &str| path.matches('/').count();
    let scenes = paths.iter().filter(|path| path.to_lowercase().ends_with(".toml"));
    if let Some(scene) = scenes.min_by_key(|path| (depth(path), **path)) {
        return Some((*scene).to_owned());
    }
    if let &[only] = paths {
        return Some(only.to_owned());
    }
    let mut folders = std::collections::BTreeMap::<&str, usize>::new();
    for path in paths {
        let (folder, name) = path.rsplit_once('/').unwrap_or(("", path));
        *folders.entry(folder).or_default() += usize::from(readable_stem(name).is_some());
    }
    let most =
        folders.iter().max_by_key(|&(folder, count)| (count, std::cmp::Reverse(depth(folder))));
    most.map(|(folder, _)| (*folder).to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Files that are dropped together are a sequence, of those frames alone; a scene among them is opened instead.
    #[test]
    fn dropped_files_are_a_sequence() {
        let of = |paths: &[&str]| {
            let paths: Vec<PathBuf> = paths.iter().map(PathBuf::from).collect();
            let (source, left_out) = Source::of_files(&paths)?;
            Some((source.input, source.frames.map(|frames| frames.to_string()), left_out))
        };
        let is = |input: &str, frames: Option<&str>, left_out: usize| {
            Some((input.to_owned(), frames.map(str::to_owned), left_out))
        };
        assert_eq!(of(&[]), None);
        assert_eq!(of(&["a/w_3.bgeo"]), is("a/w_3.bgeo", None, 0));
        assert_eq!(of(&["a/w_7.bgeo", "a/w_3.bgeo"]), is("a/w_{}.bgeo", Some("3,7"), 0));
        assert_eq!(of(&["v_1.vtk", "w_2.vtk", "w_1.vtk"]), is("w_{}.vtk", Some("1-2"), 1));
        assert_eq!(of(&["w_1.vtk", "a.TOML", "w_2.vtk"]), is("a.TOML", None, 2));
        assert_eq!(of(&["readme", "licence"]), is("readme", None, 1));
    }

    /// Of dropped files the scene is opened, the only file, or the folder of the sequence, whatever lies beside it.
    #[test]
    fn the_scene_or_the_sequence_is_opened() {
        let opened = |paths: &[&str]| opened_of(paths);
        assert_eq!(
            opened(&["a/water_1.bgeo", "a/b/x.toml", "a/scene.TOML"]).unwrap(),
            "a/scene.TOML"
        );
        assert_eq!(opened(&["water.bgeo"]).unwrap(), "water.bgeo");
        assert_eq!(opened(&["water_1.bgeo", "water_2.bgeo"]).unwrap(), "");
        let run = [
            "run/log/a.log",
            "run/log/b.txt",
            "run/old/w_1.bgeo",
            "run/p/w_1.bgeo",
            "run/p/w_2.bgeo",
        ];
        assert_eq!(opened(&run).unwrap(), "run/p");
        assert_eq!(opened(&["run/a.log", "run/b.log"]).unwrap(), "run");
        assert_eq!(opened(&[]), None);
    }
}
