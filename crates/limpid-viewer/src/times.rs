//! The times panel: milliseconds per pass, and time against error where ground truth is cheap.

use std::collections::VecDeque;
use std::sync::Arc;

use eframe::egui;
use egui_plot::{Legend, Line, Plot, PlotPoints, Points};

use crate::draw_thread::{Job, Measured, Pane};
use crate::messages::Message;
use crate::truth::{self, Point, Truth};
use crate::{Tab, Viewer};
use limpid::gpu::PassTime;
use limpid_io::error::Result;

/// Number of pictures in the plot.
const LENGTH: usize = 240;

/// Number of pictures that the table averages.
const RECENT: usize = 16;

/// Pass times of the last pictures.
#[derive(Debug, Default)]
pub(crate) struct History {
    /// Times by pass, in the order of the passes; NaN for a picture without the pass.
    passes: Vec<(&'static str, VecDeque<f64>)>,
    pictures: usize,
}

impl History {
    pub(crate) fn push(&mut self, times: &[PassTime]) {
        for time in times {
            if !self.passes.iter().any(|(name, _)| *name == time.name) {
                let blank = VecDeque::from(vec![f64::NAN; self.pictures.min(LENGTH)]);
                self.passes.push((time.name, blank));
            }
        }
        self.pictures += 1;
        for (name, series) in &mut self.passes {
            // A pass may run several times, once for each light.
            let of_pass = times.iter().filter(|time| time.name == *name);
            let ms = of_pass.map(|time| time.ms).reduce(|a, b| a + b).unwrap_or(f64::NAN);
            series.push_back(ms);
            if series.len() > LENGTH {
                series.pop_front();
            }
        }
    }

    /// Each pass with the mean of its recent times, ms.
    fn recent(&self) -> impl Iterator<Item = (&'static str, f64)> {
        self.passes.iter().filter_map(|(name, series)| {
            let recent = series.iter().rev().take(RECENT).filter(|ms| ms.is_finite());
            let (sum, count) = recent.fold((0.0, 0.0), |(sum, count), ms| (sum + ms, count + 1.0));
            (count > 0.0).then(|| (*name, sum / count))
        })
    }
}

impl Viewer {
    pub(crate) fn times(&mut self, ui: &mut egui::Ui) {
        ui.strong("Time per pass, ms; means of the last pictures");
        if self.measured.history.passes.is_empty() {
            ui.weak("No times: the adapter measures none, or nothing has been drawn.");
        } else {
            let plot = Plot::new("passes")
                .height(200.0)
                .include_y(0.0)
                .show_x(false)
                .allow_scroll(false)
                .allow_zoom(false)
                .allow_drag(false)
                .allow_boxed_zoom(false)
                .x_axis_label("pictures")
                .legend(Legend::default().position(egui_plot::Corner::LeftTop));
            plot.show(ui, |plot| {
                for (name, series) in &self.measured.history.passes {
                    let first = self.measured.history.pictures - series.len();
                    let points = series.iter().enumerate().filter(|(_, ms)| ms.is_finite());
                    let points: PlotPoints<'_> =
                        points.map(|(i, &ms)| [(first + i) as f64, ms]).collect();
                    plot.line(Line::new(*name, points).width(1.5));
                }
            });
            egui::Grid::new("means").num_columns(2).min_col_width(140.0).striped(true).show(
                ui,
                |ui| {
                    let mut sum = 0.0;
                    for (name, ms) in self.measured.history.recent() {
                        ui.label(name);
                        ui.monospace(format!("{ms:8.2}"));
                        ui.end_row();
                        sum += ms;
                    }
                    ui.strong("all passes");
                    ui.monospace(format!("{sum:8.2}"));
                    ui.end_row();
                },
            );
        }
        ui.separator();
        self.error_plot(ui);
    }

    fn error_plot(&mut self, ui: &mut egui::Ui) {
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
            let traced = self.measured.truth.is_some();
            let text =
                if traced { "Trace this view again" } else { "Trace the truth of this view" };
            let ready = !self.measured.tracing && loaded.is_some();
            if ui.add_enabled(ready, egui::Button::new(text)).clicked() {
                self.trace();
            }
            if self.measured.tracing {
                ui.spinner();
                ui.label("tracing");
            }
        });
        let Some(truth) = &self.measured.truth else {
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
            for point in &self.measured.points {
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
        if let Some(point) = self.measured.points.iter().find(|point| point.settings == present) {
            let Point { ms, flip, .. } = point;
            ui.monospace(format!("these settings: {ms:.1} ms, FLIP {flip:.4}"));
        }
        if ui.small_button("Forget the points").clicked() {
            self.measured.points.clear();
        }
    }

    /// Traces the current view on its own thread, and discards the points of the previous one.
    fn trace(&mut self) {
        let (Some(document), Some(at)) = (self.opened.document.clone(), self.frame_time()) else {
            return;
        };
        let (scene, camera, post) = (self.fine_scene(), self.eye.camera, self.jobs.post.clone());
        self.measured.points.clear();
        self.measured.truth = None;
        self.measured.tracing = true;
        self.measured.traces += 1;
        let number = self.measured.traces;
        std::thread::spawn(move || {
            let truth = truth::of(&document, &scene, &camera, at);
            post.send(Message::Traced(number, Box::new(truth)));
        });
    }

    pub(crate) fn take_truth(&mut self, number: u64, truth: Result<Truth>) {
        if number != self.measured.traces {
            return;
        }
        self.measured.tracing = false;
        match truth {
            Ok(truth) => self.measured.truth = Some(Arc::new(truth)),
            Err(error) => self.fail(&error),
        }
    }

    /// Measures the current settings on a small picture, if there is a ground truth for the view.
    pub(crate) fn compare_with_truth(&mut self) {
        if self.interface.tab != Tab::Times || self.measured.measuring || !self.is_at_rest() {
            return;
        }
        let (scene, at) = (self.fine_scene(), self.frame_time());
        let truth =
            self.measured.truth.as_ref().filter(|truth| truth.fits(&scene, &self.eye.camera, at));
        let known = self.measured.points.iter().any(|point| point.settings == scene.settings);
        if let (Some(truth), Some(loaded)) =
            (truth, self.editing.sides[self.editing.edited].loaded.clone())
            && !known
        {
            self.measured.measuring = true;
            let camera = self.eye.camera;
            let pane = Pane { scene: Arc::new(scene), camera, loaded, size: truth::SIZE };
            self.jobs.drawing.job(Job::Measure(pane, truth.clone()));
        }
    }

    pub(crate) fn take_measure(&mut self, measured: Result<Measured>) {
        self.measured.measuring = false;
        match measured {
            Ok(Measured { truth, point }) => {
                if self.measured.truth.as_ref().is_some_and(|present| Arc::ptr_eq(present, &truth))
                {
                    self.measured.points.push(point);
                }
            }
            Err(error) => {
                // Drop the truth: the next frame would fail again.
                self.measured.truth = None;
                self.fail(&error);
            }
        }
    }
}
