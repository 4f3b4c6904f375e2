//! The messages between a page and its worker, which share no memory: CBOR, and buffers that change hands.

use std::cell::RefCell;
use std::collections::BTreeSet;

use eframe::egui::ColorImage;
use glam::{DVec3, UVec2, Vec3};
use js_sys::{Array, ArrayBuffer, Float32Array, Object, Reflect, Uint8Array};
use limpid::camera::Camera;
use limpid::gpu::PassTime;
use limpid::liquid::bulk::Bulk;
use limpid::liquid::classify::{Splat, Splats};
use limpid::scene::{Light, Liquid, Medium, Scene, Shape, Solid, Surface};
use limpid::settings::Settings;
use limpid_io::adjustments::{Floor, Sun};
use limpid_io::color_by::{AttributeRange, ColorBy, ColorScale};
use limpid_io::error::{Error, Result};
use limpid_io::frame_cache::CacheState;
use limpid_io::input::{FrameTime, Loaded, Loader, RadiusFrom};
use limpid_io::particles;
use limpid_io::project::{LiquidSource, Project};
use limpid_io::sequence::{Frame, Sequence};
use limpid_io::shared_classifier::Processor;
use limpid_sim::sim::Simulation;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use wasm_bindgen::{JsCast, JsValue};

use crate::backend::core::drawing::{Drawn, Shown};
use crate::backend::core::picking::{Picked, Sight};
use crate::model::document::{Document, Source};
use crate::model::level::Level;
use crate::model::reading::Reading;
use crate::model::sketch::{enlarged, spread};
use crate::model::views::{Legend, Values, View};

/// Message of a page to its worker.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) enum Ask {
    /// Opens a source, perhaps the same one `again`; a simulation is run.
    Open { number: u64, source: Source, again: bool },
    /// Ends the simulation of an opening.
    Stop { number: u64 },
    /// Ends the simulation of an opening, whose frames stay.
    Halt { number: u64 },
    /// Opens the source of an opening again: it has more frames.
    Grow { number: u64 },
    /// Loads frames of a document ahead of playback.
    Cache {
        id: u64,
        document: u64,
        frame_times: Vec<FrameTime>,
        edits: Edits,
        processor: Processor,
        budget: u64,
    },
    /// Ends a cache.
    Uncache { id: u64 },
    /// The current frame of a cache, and the direction of playback.
    Aim { id: u64, at: usize, step: isize, looped: bool },
    /// The page has no use for a frame any more.
    Forget { frame: u64 },
    /// Draws pictures for the screen, in place of a request that has not begun.
    Draw { number: u64, panes: Vec<PaneText>, level: Level, view: Option<(String, usize)> },
    /// Draws a picture and encodes it in the format of its name.
    Save { pane: PaneText, name: String },
    /// Reads the attributes of a document's first frame.
    Attributes { number: u64, document: u64 },
    /// Finds the particle of a document in a line of sight.
    Pick { number: u64, document: u64, color_by: Option<ColorBy>, at: FrameTime, sight: Sight },
    /// Writes the scene of a document.
    SaveScene {
        document: u64,
        edits: Edits,
        color_by: Option<ColorBy>,
        camera: Camera,
        at: FrameTime,
        processor: Processor,
        name: String,
    },
    /// Loses the device, for tests.
    Lose,
}

/// Message of a worker to its page.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Tell {
    /// It begins to open a source, and does nothing else meanwhile.
    Opening(u64),
    Opened {
        number: u64,
        document: Result<DocumentText, String>,
    },
    Grown {
        number: u64,
        document: Result<DocumentText, String>,
    },
    Baked {
        number: u64,
        done: u32,
        frames: u32,
    },
    NotBaked {
        number: u64,
        error: String,
    },
    Adapter(String),
    Lost(String),
    Drawn {
        number: u64,
        level: Level,
        panes: Vec<ShownText>,
    },
    NotDrawn {
        number: u64,
        error: String,
    },
    /// A frame has loaded or failed.
    Loaded {
        id: u64,
        i: usize,
        outcome: Result<LoadedText, String>,
    },
    /// The contents of a cache have changed.
    Cached {
        id: u64,
        state: CacheState,
    },
    /// The attributes of a document's first frame.
    Attributes {
        number: u64,
        listed: Result<Vec<AttributeRange>, String>,
    },
    /// The particle in a line of sight.
    Picked {
        number: u64,
        picked: Result<Option<Picked>, String>,
    },
    /// A file for the user: its name; the buffer is its contents.
    Saved(String),
    NotSaved(String),
    /// Something that the user should know.
    Said(String),
    /// It has panicked, and ends.
    Panicked(String),
}

/// Properties of a scene that the interface changes or shows.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Edits {
    settings: Settings,
    liquid: Liquid,
    fluids: Vec<Medium>,
    lights: Vec<Light>,
    sun: Sun,
    floor: Option<f64>,
}

impl Edits {
    pub(crate) fn of(scene: &Scene) -> Self {
        Self {
            settings: scene.settings.clone(),
            liquid: scene.liquid,
            fluids: scene.fluids.clone(),
            lights: scene.lights.clone(),
            sun: Sun::of(scene),
            floor: match Floor::of(scene) {
                Floor::At(height) => Some(height),
                _ => None,
            },
        }
    }

    /// The scene of the worker with the changes of the page.
    pub(super) fn apply(&self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        scene.settings = self.settings.clone();
        scene.liquid = self.liquid;
        scene.fluids.clone_from(&self.fluids);
        if Sun::of(&scene) != self.sun {
            // The sky's disc turns with it.
            self.sun.apply(&mut scene);
        }
        scene.lights.clone_from(&self.lights);
        scene
    }

    /// The scene as the page knows it: without the solids, except for a ground.
    fn outline(&self) -> Scene {
        let mut scene = self.apply(&Scene::default());
        scene.solids = self.floor.map(ground).into_iter().collect();
        scene
    }
}

/// A level ground without end.
fn ground(height: f64) -> Solid {
    Solid {
        shape: Shape::Plane {
            origin: DVec3::new(0.0, height, 0.0),
            normal: Vec3::Y,
            half_extent: f32::INFINITY,
        },
        surface: Surface::Color(Vec3::splat(0.5)),
        lit: false,
    }
}

/// A picture to draw.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct PaneText {
    pub(super) edits: Edits,
    pub(super) camera: Camera,
    /// The number of the frame, of those that the worker has told.
    pub(super) frame: u64,
    pub(super) size: UVec2,
    pub(super) scale: Option<ColorScale>,
    pub(super) legend: bool,
}

/// A frame of particles, without them.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct LoadedText {
    /// Identifies it in requests.
    pub(super) frame: u64,
    number: i64,
    particles: usize,
    splashes: usize,
    diffuse_counts: [usize; 4],
    radius: f32,
    radius_from: RadiusFrom,
    arrays: Vec<particles::Array>,
    bulk: Bulk,
    /// Centres, relative to the origin, and radii of some of them, m: for a coarse picture until there is a first one.
    sketch: Vec<[f32; 4]>,
    origin: DVec3,
}

/// Most particles of a sketch.
const SKETCHED: usize = 4000;

impl LoadedText {
    /// A frame, with a sketch of its particles if it is the first.
    pub(super) fn of(frame: u64, loaded: &Loaded, is_first: bool) -> Self {
        let &Loaded {
            number,
            particles,
            splashes,
            diffuse_counts,
            radius_from,
            bulk,
            ref splats,
            ..
        } = loaded;
        let count = splats.aggregates.len() + splats.splashes.len();
        let larger = enlarged(count, SKETCHED);
        let bodies = splats.aggregates.len();
        let splat = |i: usize| splats.aggregates.get(i).or_else(|| splats.splashes.get(i - bodies));
        let some = spread(count, SKETCHED).filter(|_| is_first).filter_map(splat);
        let disc = |splat: &Splat| {
            let [x, y, z] = splat.centre;
            [x, y, z, larger * splat.radius]
        };
        let sketch = some.map(disc).collect();
        let (radius, origin, arrays) = (splats.radius, splats.origin, loaded.arrays.clone());
        Self {
            frame,
            number,
            particles,
            splashes,
            diffuse_counts,
            radius,
            radius_from,
            arrays,
            bulk,
            sketch,
            origin,
        }
    }

    pub(super) fn outline(&self) -> Loaded {
        let &Self { number, particles, splashes, radius, bulk, origin, .. } = self;
        let splat = |&[x, y, z, radius]: &[f32; 4]| Splat {
            centre: [x, y, z],
            radius,
            diagonal: [radius; 3],
            particle: 0,
            off_diagonal: [0.0; 3],
            tags: 0,
        };
        let aggregates = self.sketch.iter().map(splat).collect();
        let splats = Splats { radius, aggregates, origin, ..Splats::default() };
        let frame = Loaded { number, particles, splashes, splats, bulk, ..Loaded::default() };
        Loaded {
            radius_from: self.radius_from,
            diffuse_counts: self.diffuse_counts,
            arrays: self.arrays.clone(),
            ..frame
        }
    }
}

/// An open document, without what only the worker needs.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct DocumentText {
    id: u64,
    source: Source,
    scene: Edits,
    plain: Edits,
    camera: Option<Camera>,
    processor: Processor,
    color_by: Option<ColorBy>,
    plain_color_by: Option<ColorBy>,
    scale: Option<ColorScale>,
    thickness: Option<f32>,
    reading: Reading,
    simulation: Option<Simulation>,
    has_files: bool,
    numbers: Vec<i64>,
    frames: Vec<i64>,
    frame: Option<i64>,
    fps: Option<f64>,
}

impl DocumentText {
    /// A document, and the source as the page knows it.
    pub(super) fn of(document: &Document, source: Source) -> Self {
        let Document { input, plain, project, numbers, id, .. } = document;
        Self {
            id: *id,
            source,
            scene: Edits::of(&project.scene),
            plain: Edits::of(plain),
            camera: project.camera,
            processor: project.processor,
            color_by: project.color_by.clone(),
            plain_color_by: document.plain_color_by.clone(),
            scale: document.scale.clone(),
            thickness: document.thickness,
            reading: document.reading,
            simulation: project.source.simulation().cloned(),
            has_files: input.has_files(),
            numbers: numbers.clone(),
            frames: input.sequence.frames.iter().map(|frame| frame.number).collect(),
            frame: input.frame,
            fps: input.fps(),
        }
    }

    pub(super) fn outline(self) -> Document {
        let Self { id, source, scene, plain, camera, processor, simulation, numbers, .. } = self;
        let Self { color_by, plain_color_by, scale, thickness, reading, .. } = self;
        let project = Project {
            scene: scene.outline(),
            camera,
            processor,
            color_by,
            source: simulation.map_or(LiquidSource::Unspecified, LiquidSource::Simulation),
            ..Project::default()
        };
        let frames = self.frames.iter().map(|&number| Frame::new(number, "".into())).collect();
        let sequence =
            Sequence { frames, pattern: source.input.clone(), fps: self.fps, absent: Vec::new() };
        let mut input = Loader::outline_of(&project, sequence, self.has_files, self.fps);
        input.frame = self.frame;
        let (plain, plain_processor) = (plain.outline(), processor);
        Document {
            source,
            input,
            plain,
            plain_processor,
            plain_color_by,
            project,
            scale,
            thickness,
            reading,
            numbers,
            id,
        }
    }
}

/// A picture for the screen; its pixels are a buffer, and so is each channel of its values.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct ShownText {
    legend: LegendText,
    channels: usize,
    passes: Vec<(String, f64)>,
    ms: f64,
    size: UVec2,
    /// Width and height of the image.
    image: [usize; 2],
    samples: u32,
}

#[derive(Debug, Serialize, Deserialize)]
enum LegendText {
    Picture,
    Scale { title: String, low: f32, high: f32, unit: String },
    Normal,
    Light { title: String, white: f32, unit: String },
    Nothing(String),
}

impl ShownText {
    fn of(shown: &Shown, buffers: &mut Vec<ArrayBuffer>) -> Self {
        let legend = match shown.legend {
            Legend::Picture => LegendText::Picture,
            Legend::Normal => LegendText::Normal,
            Legend::Nothing(why) => LegendText::Nothing(why.into()),
            Legend::Scale { title, low, high, unit } => {
                LegendText::Scale { title: title.into(), low, high, unit: unit.into() }
            }
            Legend::Light { title, white, unit } => {
                LegendText::Light { title: title.into(), white, unit: unit.into() }
            }
        };
        buffers.push(Uint8Array::from(shown.image.as_raw()).buffer());
        let channels = shown.values.as_ref().map_or(&[][..], |values| &values.channels);
        buffers.extend(channels.iter().map(|values| Float32Array::from(&values[..]).buffer()));
        Self {
            legend,
            channels: channels.len(),
            passes: shown.passes.iter().map(|pass| (pass.name.into(), pass.ms)).collect(),
            ms: shown.ms,
            size: shown.size,
            image: shown.image.size,
            samples: shown.samples,
        }
    }

    fn shown(self, buffers: &mut impl Iterator<Item = ArrayBuffer>) -> Shown {
        let legend = match self.legend {
            LegendText::Picture => Legend::Picture,
            LegendText::Normal => Legend::Normal,
            LegendText::Nothing(why) => Legend::Nothing(interned(why)),
            LegendText::Scale { title, low, high, unit } => {
                Legend::Scale { title: interned(title), low, high, unit: interned(unit) }
            }
            LegendText::Light { title, white, unit } => {
                Legend::Light { title: interned(title), white, unit: interned(unit) }
            }
        };
        let pixels = buffers.next().map(|buffer| Uint8Array::new(&buffer).to_vec());
        let image = ColorImage::from_rgba_premultiplied(self.image, &pixels.unwrap_or_default());
        let channel = |buffer: ArrayBuffer| Float32Array::new(&buffer).to_vec();
        let channels: Vec<Vec<f32>> = buffers.take(self.channels).map(channel).collect();
        let pass = |(name, ms)| PassTime { name: interned(name), ms };
        Shown {
            image,
            legend,
            values: (self.channels > 0).then_some(Values { size: self.size, channels }),
            passes: self.passes.into_iter().map(pass).collect(),
            ms: self.ms,
            size: self.size,
            samples: self.samples,
        }
    }
}

/// A name of a pass or of a quantity: there are few, and each is kept once for good.
fn interned(name: String) -> &'static str {
    thread_local! {
        static NAMES: RefCell<BTreeSet<&'static str>> = RefCell::default();
    }
    NAMES.with_borrow_mut(|names| match names.get(name.as_str()) {
        Some(known) => known,
        None => {
            let new: &'static str = name.leak();
            names.insert(new);
            new
        }
    })
}

/// The texts and buffers of drawn pictures.
pub(super) fn drawn_text(drawn: &Drawn) -> (Tell, Vec<ArrayBuffer>) {
    let mut buffers = Vec::new();
    let panes = drawn.panes.iter().map(|shown| ShownText::of(shown, &mut buffers)).collect();
    (Tell::Drawn { number: drawn.number, level: drawn.level, panes }, buffers)
}

/// Drawn pictures from their texts and buffers.
pub(super) fn drawn(
    number: u64,
    level: Level,
    panes: Vec<ShownText>,
    buffers: Vec<ArrayBuffer>,
) -> Drawn {
    let mut buffers = buffers.into_iter();
    let panes = panes.into_iter().map(|shown| shown.shown(&mut buffers)).collect();
    Drawn { number, level, panes }
}

pub(super) fn view_text(view: View) -> Option<(String, usize)> {
    match view {
        View::Picture => None,
        View::Image(aov, layer) => Some((aov.to_string(), layer)),
    }
}

pub(super) fn view(text: Option<(String, usize)>) -> View {
    let image = text.and_then(|(aov, layer)| Some(View::Image(aov.parse().ok()?, layer)));
    image.unwrap_or(View::Picture)
}

/// An error that was told as text.
pub(super) fn told<T>(outcome: Result<T, String>) -> Result<T> {
    outcome.map_err(Error::Usage)
}

/// A message as a JavaScript object, and the buffers in it that change hands.
pub(super) fn packed(message: &impl Serialize, buffers: Vec<ArrayBuffer>) -> (JsValue, Array) {
    let mut text = Vec::new();
    ciborium::into_writer(message, &mut text).expect("memory takes what is written");
    let transfer: Array = buffers.into_iter().collect();
    let object = Object::new();
    set(&object, "message", &Uint8Array::from(text.as_slice()));
    set(&object, "buffers", &transfer);
    (object.into(), transfer)
}

/// Sets a property of a JavaScript object.
pub(super) fn set(object: &Object, name: &str, value: &JsValue) {
    // Fails for frozen objects alone.
    let _ = Reflect::set(object, &name.into(), value);
}

/// The property of a JavaScript object, if it has it.
pub(super) fn get(object: &JsValue, name: &str) -> Option<JsValue> {
    let value = Reflect::get(object, &name.into()).ok()?;
    (!value.is_undefined() && !value.is_null()).then_some(value)
}

/// A message and its buffers; `None` for anything else.
pub(super) fn unpacked<T: DeserializeOwned>(object: &JsValue) -> Option<(T, Vec<ArrayBuffer>)> {
    let message: Uint8Array = get(object, "message")?.dyn_into().ok()?;
    let buffers: Array = get(object, "buffers")?.dyn_into().ok()?;
    let message = ciborium::from_reader(message.to_vec().as_slice()).ok()?;
    Some((message, buffers.iter().map(JsCast::unchecked_into).collect()))
}

/// Message of a JavaScript error.
pub(super) fn text_of(error: &JsValue) -> String {
    let message = get(error, "message").and_then(|message| message.as_string());
    message.unwrap_or_else(|| format!("{error:?}"))
}
