//! The particle that was clicked.

use glam::DVec2;

use crate::app::Viewer;
use crate::backend::core::picking::{Picked, Sight};
use limpid_io::error::Result;

impl Viewer {
    /// Asks for the particle at the place that was clicked, if one was.
    pub(super) fn pick(&mut self) {
        let at = self.stage.frame_time();
        // Its values are those of one frame.
        self.picture.picked.take_if(|picked| Some(picked.at) != at);
        let Some(place) = self.picture.clicked.take() else { return };
        let (Some(document), Some(at)) = (self.opened.document.clone(), at) else { return };
        self.picture.picked = None;
        self.picture.picks += 1;
        let size = self.picture.full_size(&self.stage);
        let place = DVec2::new(place.x.into(), place.y.into());
        let sight = Sight::through(&self.stage.eye.camera, size, place);
        let by = self.stage.colors.by.clone();
        self.backend.pick(self.picture.picks, (&document, by), at, sight);
    }

    pub(super) fn take_picked(&mut self, number: u64, picked: Result<Option<Picked>>) {
        if number != self.picture.picks {
            return;
        }
        match picked {
            Ok(picked) => self.picture.picked = picked,
            Err(error) => self.fail(&error),
        }
    }
}
