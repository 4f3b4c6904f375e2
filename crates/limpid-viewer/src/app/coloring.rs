//! Colours by an attribute of the particles: another one, another map or range, and what there is.

#[cfg(target_arch = "wasm32")]
use limpid_io::color_by::ColorBy;
use limpid_io::color_by::{Attribute, AttributeRange, ColorRange, MapName};
use limpid_io::error::{Error, Result};
use limpid_io::notice::Notice;
use limpid_io::overlay::legend_fits;

use glam::UVec2;

use crate::app::Viewer;
use crate::app::state::Attributes;
use crate::model::coloring::Coloring;
use crate::model::document::Source;

impl Viewer {
    /// Colours the particles by an attribute, or as they were opened: reads them again.
    pub(super) fn color_by(&mut self, attribute: Option<Attribute>) {
        let Some(document) = &self.opened.document else { return };
        let map = self.stage.colors.by.as_ref().map(|by| by.map);
        let mut source = document.source.clone();
        drop_overrides(&mut source, &[""]);
        let adjusted = &mut source.adjustments;
        adjusted.colormap = map.filter(|_| attribute.as_ref().is_some_and(Attribute::is_mapped));
        adjusted.color_range = None;
        if attribute.is_some() {
            // Opaque bodies have neither.
            (adjusted.medium, adjusted.physical, adjusted.tint) = (None, false, None);
        }
        adjusted.color_by = attribute;
        self.reopen(source);
    }

    /// Shows values by another map, over another range or the usual one. Particles are read again only if that is not
    /// known.
    pub(super) fn recolor(&mut self, map: MapName, range: Option<[f32; 2]>) {
        let Some(document) = &self.opened.document else { return };
        if let Some([low, high]) = range.filter(|ends| !ColorRange::rises(*ends)) {
            let problem = format!("a range of colors from {low} to {high}: the smaller one first");
            return self.fail(&Error::Usage(problem));
        }
        let usual = document.usual_range();
        if range.is_some() || usual.is_some() {
            return self.stage.colors.set(map, range, usual);
        }
        let mut source = document.source.clone();
        drop_overrides(&mut source, &["colormap", "color_range"]);
        if document.plain_color_by.is_some() {
            source.adjustments.colormap = Some(map);
            source.adjustments.color_range = Some(ColorRange::Auto);
        } else {
            source.overrides.push(format!("liquid.colormap={map}"));
        }
        self.stage.colors = Coloring::of(document, self.stage.colors.legend);
        self.reopen(source);
    }

    /// Takes colours that overrides have set. The particles are read again for another attribute.
    #[cfg(target_arch = "wasm32")]
    pub(super) fn set_colors(&mut self, new: Option<ColorBy>, overrides: &[String]) {
        let now = self.stage.colors.by.as_ref();
        match (now, new) {
            (now, Some(new)) if now.is_none_or(|now| now.attribute != new.attribute) => {
                let Some(document) = &self.opened.document else { return };
                let mut source = document.source.clone();
                source.overrides.extend_from_slice(overrides);
                self.reopen(source);
            }
            (_, Some(new)) => self.recolor(new.map, new.range),
            // A scene without colours is one of the edited pair.
            (_, None) => {}
        }
    }

    /// Asks for the attributes of the files, once.
    pub(super) fn list_attributes(&mut self) {
        let Some(document) = &self.opened.document else { return };
        if matches!(self.opened.attributes, Attributes::Unknown) {
            let number = self.opened.openings;
            self.opened.attributes = Attributes::Asked(number);
            self.backend.attributes(number, document);
        }
    }

    pub(super) fn take_attributes(&mut self, number: u64, listed: Result<Vec<AttributeRange>>) {
        if !matches!(self.opened.attributes, Attributes::Asked(asked) if asked == number) {
            return;
        }
        if let Err(error) = &listed {
            self.fail(error);
        }
        self.opened.attributes = Attributes::Known(listed.unwrap_or_default());
    }

    /// Says so if pictures of this size, which are to have a legend, are too small for it.
    pub(super) fn check_legend(&mut self, size: UVec2) {
        let scale = self.stage.colors.legend_of(self.stage.editing.scene());
        if scale.is_some_and(|scale| !legend_fits(size, scale)) {
            self.show_info(Notice::NoLegend(size).to_string());
        }
    }
}

/// Drops the overrides of these keys of the liquid, or of all that begin so.
fn drop_overrides(source: &mut Source, keys: &[&str]) {
    let is_one = |text: &str| {
        let key = text.trim_start().strip_prefix("liquid.");
        key.is_some_and(|text| keys.iter().any(|key| text.starts_with(key)))
    };
    source.overrides.retain(|text| !is_one(text));
}
