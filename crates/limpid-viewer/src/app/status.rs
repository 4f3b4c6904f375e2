//! State of the viewer, for the page and its tests.

use serde_json::{Value, json};

use crate::app::Viewer;

impl Viewer {
    /// State of the viewer, as an object.
    pub fn status(&self) -> Value {
        let side = self.picture.edited(&self.stage);
        let shown = side.picture.shown.as_ref();
        json!({
            "adapter": self.interface.adapter,
            "opening": self.opened.pending(),
            "open": self.opened.document.as_ref().map(|document| &document.source.input),
            "frame": self.stage.frame_time().map(|at| at.frame),
            "index": self.stage.playback.index(),
            "frames": self.stage.playback.count(),
            "playing": self.stage.playback.playing,
            "particles": side.loaded.as_ref().map(|loaded| loaded.particles),
            "loaded": self.opened.frames.state().loaded.len(),
            "simulates": self.opened.simulates(),
            "atRest": self.is_at_rest(),
            "pictures": self.picture.answered,
            "size": self.picture.viewport_size.to_array(),
            "shown": shown.map(|facts| json!({
                "size": facts.size.to_array(), "samples": facts.samples, "ms": facts.ms,
                "frame": facts.caption.at.map(|at| at.frame), "view": facts.caption.view.label(),
            })),
            "passes": self.times.last().map(|(name, ms)| json!([name, ms])).collect::<Vec<_>>(),
            "eye": self.stage.eye.camera.eye.to_array(),
            "view": self.picture.view.label(),
            "invites": self.interface.invites,
            "colors": self.stage.colors.scale.as_ref().map(|scale| json!({
                "name": scale.name, "unit": scale.unit, "map": scale.map, "range": scale.range,
                "legend": self.stage.colors.legend,
            })),
            "notices": self.notices().iter().map(|notice| {
                json!({ "text": notice.text, "error": notice.error })
            }).collect::<Vec<_>>(),
        })
    }
}
