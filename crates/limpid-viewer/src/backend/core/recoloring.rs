//! The colours of loaded particles by other maps and ranges than they were loaded with: nothing is read again.

use std::collections::VecDeque;
use std::sync::{Arc, Weak};

use crate::backend::core::drawing::Pane;
use limpid::liquid::{ColorMap, Colors};
use limpid_io::error::Result;
use limpid_io::input::Loaded;

/// Colours that are kept: those of both panes.
const KEPT: usize = 2;

/// The last colours that were made, of which several pictures are drawn.
#[derive(Debug, Default)]
pub(crate) struct Recolored(VecDeque<(Weak<Loaded>, ColorMap, Colors)>);

impl Recolored {
    /// The colours of a pane's particles, if they are not those that they were loaded with.
    ///
    /// # Errors
    /// As [`Colors::over`].
    pub(crate) fn of(&mut self, pane: &Pane) -> Result<Option<Colors>> {
        let loaded = &pane.loaded;
        let own = loaded.splats.colors.as_ref();
        let (Some(scale), Some(own)) = (&pane.scale, own) else { return Ok(None) };
        let map = scale.map.over(scale.range);
        if own.map().is_none_or(|own| *own == map) {
            return Ok(None);
        }
        let is_it = |(of, by, _): &&(Weak<Loaded>, ColorMap, Colors)| {
            of.as_ptr() == Arc::as_ptr(loaded) && *by == map
        };
        if let Some((_, _, colors)) = self.0.iter().find(is_it) {
            return Ok(Some(colors.clone()));
        }
        let colors = own.over(map.clone())?;
        self.0.truncate(KEPT - 1);
        self.0.push_front((Arc::downgrade(loaded), map, colors.clone()));
        Ok(Some(colors))
    }
}
