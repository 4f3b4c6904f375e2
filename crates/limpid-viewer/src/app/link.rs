//! The state of a viewer in the address of its page.
//!
//! | parameter | meaning |
//! |---|---|
//! | `scene` | URL of a scene or of particles; a pattern such as `frames/water_{}.bgeo`; a folder, if it ends in `/` |
//! | `demo` | one of the demos instead: `dam_break`, `fountain`, `lagoon`, `vase` |
//! | `in` | URL of a scene in which the particles are drawn, as `--scene` |
//! | `frames` | the frames, as `--frames`; with them a pattern needs no list of files |
//! | `frame` | number of the frame that is shown |
//! | `play` | plays; `0`: not even a simulation |
//! | `camera` | as `--camera`, in the world, where y is up |
//! | `view` | the intermediate image, by its name in `--aov` |
//! | `refine` | `0`: a picture at rest has the rays of its settings, not four at least |
//! | `set` | a setting, as `--set`; any number of times |
//! | `look`, `sky`, `sun`, `floor`, `ior`, `tint`, `medium`, `physical`, `color-by`, `colormap`, `range`, `legend`, `up`, `scale`, `fps`, `radius`, `missing` | as the options of `limpid render` |

use std::fmt::Display;
use std::str::FromStr;

use limpid::liquid::Up;
use limpid_io::error::{Error, Result};
use limpid_io::input::Missing;
use limpid_io::project::differences;

use crate::app::Viewer;
use crate::app::state::Wishes;
use crate::backend::web::demos;
use crate::model::demos::DEMOS;
use crate::model::document::Source;
use crate::model::views::View;

/// Source and wishes in an address.
pub(crate) struct Link {
    pub(crate) source: Source,
    pub(crate) wishes: Wishes,
    /// Whether the address names no source, and the first demo is shown.
    pub(crate) is_first: bool,
}

/// Reads the parameters of an address. Unknown ones are the server's.
///
/// # Errors
/// [`Error::Usage`] naming the parameter and its problem.
pub(crate) fn parse(query: &[(String, String)]) -> Result<Link> {
    let mut source = Source::default();
    let mut wishes = Wishes::default();
    let adjusted = &mut source.adjustments;
    for (name, value) in query {
        let value = value.as_str();
        match name.as_str() {
            "scene" => source.input = value.to_owned(),
            "demo" => {
                let known = DEMOS.iter().find(|demo| demo.name == value);
                let names: Vec<_> = DEMOS.iter().map(|demo| demo.name).collect();
                let problem = || fail(name, format!("expected one of {}", names.join(", ")));
                source.input = known.ok_or_else(problem)?.source()?.input;
            }
            "in" => source.scene = Some(value.into()),
            "frames" => source.frames = Some(parsed(name, value)?),
            "frame" => wishes.frame = Some(parsed(name, value)?),
            "play" => wishes.play = Some(value != "false" && value != "0"),
            "camera" => wishes.camera = Some(parsed(name, value)?),
            "view" => wishes.view = Some(parsed(name, value)?),
            "refine" => wishes.unrefined = value == "false" || value == "0",
            "set" => source.overrides.push(value.to_owned()),
            "look" => adjusted.look = Some(parsed(name, value)?),
            "sky" => adjusted.sky = Some(parsed(name, value)?),
            "sun" => adjusted.sun = Some(parsed(name, value)?),
            "floor" => adjusted.floor = Some(parsed(name, value)?),
            "ior" => adjusted.ior = Some(parsed(name, value)?),
            "medium" => adjusted.medium = Some(parsed(name, value)?),
            "physical" => adjusted.physical = value != "false" && value != "0",
            "tint" => adjusted.tint = Some(parsed(name, value)?),
            "color-by" => adjusted.color_by = Some(value.into()),
            "colormap" => adjusted.colormap = Some(parsed(name, value)?),
            "legend" => wishes.legend = value != "false" && value != "0",
            "range" => adjusted.color_range = Some(parsed(name, value)?),
            "up" => {
                adjusted.up = Some(match value {
                    "y" => Up::Y,
                    "z" => Up::Z,
                    _ => return Err(fail(name, "expected y or z")),
                });
            }
            "scale" => adjusted.scale = Some(parsed(name, value)?),
            "fps" => adjusted.fps = Some(parsed(name, value)?),
            "radius" => source.radius = Some(parsed(name, value)?),
            "missing" => source.missing = parsed(name, value)?,
            _ => {}
        }
    }
    let is_first = source.input.is_empty();
    if is_first {
        source.input = demos::first_source();
    }
    Ok(Link { source, wishes, is_first })
}

fn parsed<T: FromStr<Err: Display>>(name: &str, value: &str) -> Result<T> {
    value.parse().map_err(|error| fail(name, format!("`{value}`: {error}")))
}

fn fail(name: &str, problem: impl Display) -> Error {
    Error::Usage(format!("{name} in the address: {problem}"))
}

/// The parameters that open the picture of a viewer; `None` if it shows files of the user, or nothing.
pub(crate) fn query(viewer: &Viewer) -> Option<String> {
    let document = viewer.opened.document.as_ref()?;
    let source = &document.source;
    let mut pairs: Vec<(&str, String)> = Vec::new();
    let is_url = |path: &str| path.starts_with("http:") || path.starts_with("https:");
    match source.input.strip_prefix(demos::FOLDER) {
        Some(demo) => pairs.push(("demo", demo.trim_end_matches(".toml").into())),
        None if is_url(&source.input) => pairs.push(("scene", source.input.clone())),
        None => return None,
    }
    if let Some(scene) = &source.scene {
        pairs.push(("in", scene.to_string_lossy().into_owned()));
    }
    if let Some(frames) = &source.frames {
        pairs.push(("frames", frames.to_string()));
    }
    let playback = &viewer.stage.playback;
    if let Some(at) = viewer.stage.frame_time().filter(|_| playback.count() > 1) {
        pairs.push(("frame", at.frame.to_string()));
        pairs.push(("play", u8::from(playback.playing).to_string()));
    }
    if viewer.stage.eye.camera != document.project.camera_for(Default::default()) {
        pairs.push(("camera", viewer.stage.eye.camera.to_string()));
    }
    if let View::Image(aov, _) = viewer.picture.view {
        pairs.push(("view", aov.to_string()));
    }
    if !viewer.picture.refine {
        pairs.push(("refine", "0".into()));
    }
    if let Some(radius) = source.radius {
        pairs.push(("radius", radius.to_string()));
    }
    match source.missing {
        Missing::Error => {}
        Missing::Empty => pairs.push(("missing", "empty".into())),
        Missing::Hold => pairs.push(("missing", "hold".into())),
    }
    pairs.extend(source.adjustments.arguments());
    pairs.extend(source.adjustments.physical.then(|| ("physical", "true".to_owned())));
    pairs.extend(source.adjustments.fps.map(|fps| ("fps", fps.to_string())));
    pairs.extend(source.overrides.iter().map(|set| ("set", set.clone())));
    let (edited, colors) = (viewer.stage.editing.scene(), &viewer.stage.colors);
    if colors.legend_of(edited).is_some() {
        pairs.push(("legend", "1".into()));
    }
    let opened = (&document.project.scene, document.project.color_by.as_ref());
    let edits = differences::between(opened, (edited, colors.by.as_ref()));
    pairs.extend(edits.into_iter().map(|set| ("set", set)));
    let encoded = |text: &str| String::from(js_sys::encode_uri_component(text));
    let pairs = pairs.iter().map(|(name, value)| format!("{name}={}", encoded(value)));
    Some(pairs.collect::<Vec<_>>().join("&"))
}
