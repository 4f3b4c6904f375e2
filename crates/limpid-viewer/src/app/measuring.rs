//! Measuring time and error against ground truth.

use std::sync::Arc;

use crate::app::Viewer;
use crate::backend::core::drawing::{Measured, Pane};
use crate::backend::core::truth::{SIZE, Truth};
use crate::panels::side::Tab;
use limpid_io::error::Result;

impl Viewer {
    /// Traces the current view, and discards the points of the previous one.
    pub(super) fn trace(&mut self) {
        let (Some(document), Some(at)) = (self.opened.document.clone(), self.stage.frame_time())
        else {
            return;
        };
        let scene = self.picture.fine_scene(&self.stage.editing);
        let number = self.errors.begin();
        self.backend.trace(number, document, scene, self.stage.eye.camera, at);
    }

    pub(crate) fn take_truth(&mut self, number: u64, truth: Result<Truth>) {
        if number != self.errors.traces {
            return;
        }
        self.errors.tracing = false;
        match truth {
            Ok(truth) => self.errors.truth = Some(Arc::new(truth)),
            Err(error) => self.fail(&error),
        }
    }

    /// Measures the current settings on a small picture, if there is a ground truth for the view.
    pub(crate) fn compare_with_truth(&mut self) {
        if self.interface.tab != Tab::Times || self.errors.measuring || !self.is_at_rest() {
            return;
        }
        let (scene, at) = (self.picture.fine_scene(&self.stage.editing), self.stage.frame_time());
        let truth = self
            .errors
            .truth
            .as_ref()
            .filter(|truth| truth.fits(&scene, &self.stage.eye.camera, at));
        let known = self.errors.points.iter().any(|point| point.settings == scene.settings);
        if let (Some(truth), Some(loaded)) =
            (truth, self.picture.edited(&self.stage).loaded.clone())
            && !known
        {
            self.errors.measuring = true;
            let camera = self.stage.eye.camera;
            let (scene, scale) = (Arc::new(scene), None);
            let pane = Pane { scene, camera, loaded, size: SIZE, scale, legend: false };
            self.backend.measure(pane, truth.clone());
        }
    }

    pub(crate) fn take_measure(&mut self, measured: Result<Measured>) {
        self.errors.measuring = false;
        match measured {
            Ok(Measured { truth, point }) => {
                if self.errors.truth.as_ref().is_some_and(|present| Arc::ptr_eq(present, &truth)) {
                    self.errors.points.push(point);
                }
            }
            Err(error) => {
                // Drop the truth: the next frame would fail again.
                self.errors.truth = None;
                self.fail(&error);
            }
        }
    }
}
