//! Drawn pictures as textures.

use std::sync::Arc;

use eframe::egui::{self, TextureHandle, TextureOptions};
use glam::UVec2;

use crate::backend::core::drawing::Shown;
use crate::model::views::{Legend, Values};
use crate::picture::captions::Caption;

/// A picture on the screen.
#[derive(Clone, Default)]
pub(crate) struct Picture {
    pub(crate) texture: Option<TextureHandle>,
    pub(crate) shown: Option<Arc<Facts>>,
}

impl Picture {
    /// A texture of its own, since the flipbook may keep the last one.
    pub(crate) fn new(ctx: &egui::Context, shown: Shown, caption: Caption) -> Self {
        let Shown { image, legend, values, ms, size, samples, .. } = shown;
        let options = match legend {
            Legend::Picture => TextureOptions::LINEAR,
            _ => TextureOptions::NEAREST,
        };
        let texture = Some(ctx.load_texture("picture", image, options));
        let facts = Facts { caption, size, samples, ms, legend, values };
        Self { texture, shown: Some(Arc::new(facts)) }
    }

    /// Memory of its pixels and values, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        let values = self.shown.as_ref().and_then(|facts| facts.values.as_ref());
        let values = values.map_or(0, |values| values.channels.iter().map(Vec::len).sum());
        let pixels = self.texture.as_ref().map_or(0, TextureHandle::byte_size);
        (pixels + size_of::<f32>() * values) as u64
    }
}

/// Properties of the picture shown.
#[derive(Debug)]
pub(crate) struct Facts {
    pub(crate) caption: Caption,
    pub(crate) size: UVec2,
    pub(crate) samples: u32,
    pub(crate) ms: f64,
    pub(crate) legend: Legend,
    pub(crate) values: Option<Values>,
}

impl std::fmt::Debug for Picture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Picture").field("shown", &self.shown).finish_non_exhaustive()
    }
}
