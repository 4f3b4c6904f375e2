//! The colours of the particles by an attribute, as they are shown.

use limpid::scene::Scene;
use limpid_io::color_by::{ColorBy, ColorScale, MapName};

use crate::model::document::Document;

/// The attribute that colours the particles, its map, its range, and the legend. They hold for settings A and B.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Coloring {
    /// The attribute with the map and the range that were chosen; `None` if nothing colours the particles.
    pub by: Option<ColorBy>,
    /// The values that the colours show; `None` if no map shows the attribute.
    pub scale: Option<ColorScale>,
    /// Whether a legend is wanted.
    pub legend: bool,
}

impl Coloring {
    /// The colours of a document as it was opened.
    pub fn of(document: &Document, legend: bool) -> Self {
        Self { by: document.project.color_by.clone(), scale: document.scale.clone(), legend }
    }

    /// Takes another map, and another range or the `usual` one of the document.
    pub(crate) fn set(&mut self, map: MapName, range: Option<[f32; 2]>, usual: Option<[f32; 2]>) {
        let (Some(by), Some(scale)) = (&mut self.by, &mut self.scale) else { return };
        let Some(shown) = range.or(usual) else { return };
        (by.map, by.range) = (map, range);
        (scale.map, scale.range, scale.automatic) = (map, shown, range.is_none());
    }

    /// The colours that are shown by another map or range than in this document.
    pub(crate) fn edits(&self, document: &Document) -> Option<&ColorBy> {
        self.by.as_ref().filter(|_| self.by != document.project.color_by)
    }

    /// The legend of this scene's pictures.
    pub(crate) fn legend_of(&self, scene: &Scene) -> Option<&ColorScale> {
        self.scale.as_ref().filter(|_| self.legend && scene.is_opaque())
    }
}
