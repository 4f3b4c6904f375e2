//! Time against error, where ground truth is cheap: a plot of the times panel.

use std::sync::Arc;

use eframe::egui;
use egui_plot::{Plot, PlotPoints, Points};

use crate::backend::core::messages::Message;
use crate::backend::core::truth::{self, Point, Truth};
use crate::backend::native::draw_thread::{Job, Measured, Pane};
use crate::{Tab, Viewer};
use limpid_io::error::Result;

/// Ground truth, and the errors and times measured against it.
#[derive(Debug, Default)]
pub(crate) struct Errors {
    truth: Option<Arc<Truth>>,
    /// Number of traces requested; results of earlier ones are discarded.
    traces: u64,
    tracing: bool,
    measuring: bool,
    points: Vec<Point>,
}

impl Errors {
    /// Discards the ground truth, also one that is being traced: another view is open.
    pub(crate) fn forget(&mut self) {
        self.truth = None;
        self.traces += 1;
        self.tracing = false;
    }

    /// As [`Errors::forget`], for another document.
    pub(crate) fn clear(&mut self) {
        self.forget();
        self.points.clear();
    }
}

impl Viewer {
    pub(crate) fn error_plot(&mut self, ui: &mut egui::Ui) {
        let size = truth::SIZE;
        ui.strong(format!("Time against error, at {} × {}", size.x, size.y));
        let loaded = self.editing.sides[self.editing.edited].loaded.clone();
        let particles = loaded.as_ref().map_or(0, |loaded| loaded.particles);
        if let Some(why) = self.opened.document.as_ref().and_then(|document| {
            truth::missing(document, &self.editing.scenes[self.editing.edited], particles)
        }) {
            ui.weak(why);
            return;
        }
        ui.horizontal(|ui| {
            let traced = self.errors.truth.is_some();
            let text =
                if traced { "Trace this view again" } else { "Trace the truth of this view" };
            let ready = !self.errors.tracing && loaded.is_some();
            if ui.add_enabled(ready, egui::Button::new(text)).clicked() {
                self.trace();
            }
            if self.errors.tracing {
                ui.spinner();
                ui.label("tracing");
            }
        });
        let Some(truth) = &self.errors.truth else {
            ui.weak("Each of your settings then becomes a point: its time, and its mean FLIP to the truth.");
            return;
        };
        if !truth.fits(
            &self.editing.scenes[self.editing.edited],
            &self.eye.camera,
            self.frame_time(),
        ) {
            ui.weak("View or liquid have changed: trace the truth again to measure here.");
        }
        let present = self.fine_scene().settings;
        let plot = Plot::new("error")
            .height(200.0)
            .include_x(0.0)
            .include_y(0.0)
            .allow_scroll(false)
            .x_axis_label("ms")
            .y_axis_label("mean FLIP");
        plot.show(ui, |plot| {
            for point in &self.errors.points {
                let now = point.settings == present;
                let color = match now {
                    true => egui::Color32::from_rgb(240, 150, 40),
                    false => egui::Color32::from_rgb(90, 160, 220),
                };
                let at = PlotPoints::from(vec![[point.ms, point.flip]]);
                let radius = if now { 5.0 } else { 4.0 };
                plot.points(
                    Points::new(point.description.as_str(), at)
                        .radius(radius)
                        .color(color)
                        .filled(true),
                );
            }
        });
        if let Some(point) = self.errors.points.iter().find(|point| point.settings == present) {
            let Point { ms, flip, .. } = point;
            ui.monospace(format!("these settings: {ms:.1} ms, FLIP {flip:.4}"));
        }
        if ui.small_button("Forget the points").clicked() {
            self.errors.points.clear();
        }
    }

    /// Traces the current view on its own thread, and discards the points of the previous one.
    fn trace(&mut self) {
        let (Some(document), Some(at)) = (self.opened.document.clone(), self.frame_time()) else {
            return;
        };
        let (scene, camera, post) = (self.fine_scene(), self.eye.camera, self.jobs.post.clone());
        self.errors.points.clear();
        self.errors.truth = None;
        self.errors.tracing = true;
        self.errors.traces += 1;
        let number = self.errors.traces;
        std::thread::spawn(move || {
            let truth = truth::of(&document, &scene, &camera, at);
            post.send(Message::Traced(number, Box::new(truth)));
        });
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
        let (scene, at) = (self.fine_scene(), self.frame_time());
        let truth =
            self.errors.truth.as_ref().filter(|truth| truth.fits(&scene, &self.eye.camera, at));
        let known = self.errors.points.iter().any(|point| point.settings == scene.settings);
        if let (Some(truth), Some(loaded)) =
            (truth, self.editing.sides[self.editing.edited].loaded.clone())
            && !known
        {
            self.errors.measuring = true;
            let camera = self.eye.camera;
            let pane = Pane { scene: Arc::new(scene), camera, loaded, size: truth::SIZE };
            self.jobs.drawing.job(Job::Measure(pane, truth.clone()));
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
