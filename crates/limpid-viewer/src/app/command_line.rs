//! The command that draws the current view without a window.

use glam::UVec2;

use crate::model::coloring::Coloring;
use crate::model::document::Document;
use limpid::camera::Camera;
use limpid::liquid::Up;
use limpid::scene::Scene;
use limpid_io::input::{FrameTime, Missing};
use limpid_io::project::differences;
use limpid_io::shared_classifier::Processor;

/// The `limpid render` command that draws a scene in these colours at a frame time from `camera` into `output`: for a POSIX
/// shell, in the folder that the input's path is relative to.
pub fn command_line(
    document: &Document,
    (scene, processor, colors): (&Scene, Processor, &Coloring),
    camera: &Camera,
    at: FrameTime,
    size: UVec2,
    output: &str,
) -> String {
    let source = &document.source;
    let mut words = vec!["limpid".to_owned(), "render".to_owned(), quoted(&source.input)];
    let mut option = |name: &str, value: String| {
        // One word, so that a value may begin with a sign.
        words.push(format!("--{name}={}", quoted(&value)));
    };
    if let Some(scene) = &source.scene {
        option("scene", scene.display().to_string());
    }
    if let Some(radius) = source.radius {
        option("radius", radius.to_string());
    }
    if !source.options.map.is_empty() {
        option("map", source.options.map.to_string());
    }
    if !source.options.select.is_automatic() {
        option("select", source.options.select.to_string());
    }
    for (name, value) in source.adjustments.arguments() {
        option(name, value);
    }
    match source.missing {
        Missing::Error => {}
        Missing::Empty => option("missing", "empty".into()),
        Missing::Hold => option("missing", "hold".into()),
    }
    if at.fraction > 0.0 {
        // Interpolate between these two frames, whatever others exist.
        option("frames", format!("{},{}", at.frame, at.next));
        option("at", at.time().to_string());
    } else if document.input.sequence.frames.len() > 1 {
        option("frames", at.frame.to_string());
    }
    option("size", format!("{}x{}", size.x, size.y));
    option("camera", camera.to_string());
    if document.input.up().0 != Up::Y {
        // The viewer's camera is in the world.
        option("camera-up", Up::Y.to_string());
    }
    let plain = (&document.plain, document.plain_color_by.as_ref());
    for set in differences::between(plain, (scene, colors.by.as_ref())) {
        option("set", set);
    }
    if processor != document.plain_processor {
        option("set", format!("classify.on={processor}"));
    }
    if colors.legend_of(scene).is_some() {
        words.push("--legend".to_owned());
    }
    if source.adjustments.physical {
        words.push("--physical".to_owned());
    }
    words.push("-o".to_owned());
    words.push(quoted(output));
    words.join(" ")
}

/// Quotes a word for a POSIX shell.
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-+/=:,@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', r"'\''"))
}
