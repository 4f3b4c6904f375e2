//! Time against error, where ground truth is cheap: a plot of the times panel.

use std::sync::Arc;

use eframe::egui;
use egui_plot::{Plot, PlotPoints, Points};

use crate::backend::core::truth::{Point, SIZE, Truth};
use crate::panels::Command;
use limpid::settings::Settings;

/// Ground truth, and the errors and times measured against it.
#[derive(Debug, Default)]
pub(crate) struct Errors {
    pub(crate) truth: Option<Arc<Truth>>,
    /// Number of traces requested; results of earlier ones are discarded.
    pub(crate) traces: u64,
    pub(crate) tracing: bool,
    pub(crate) measuring: bool,
    pub(crate) points: Vec<Point>,
}

/// State of the document that decides what the plot offers.
pub(crate) struct Present<'a> {
    /// Why there is no ground truth for the document, if there is none.
    pub(crate) missing: Option<&'static str>,
    /// Whether particles are loaded.
    pub(crate) is_loaded: bool,
    /// Whether the view is that of the ground truth.
    pub(crate) is_traced: bool,
    /// The settings of the picture at rest.
    pub(crate) settings: &'a Settings,
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

    /// Begins a trace, and discards the points of the previous one. Returns its number.
    pub(crate) fn begin(&mut self) -> u64 {
        self.points.clear();
        self.truth = None;
        self.tracing = true;
        self.traces += 1;
        self.traces
    }

    pub(crate) fn show(
        &mut self,
        ui: &mut egui::Ui,
        present: &Present<'_>,
        commands: &mut Vec<Command>,
    ) {
        ui.strong(format!("Time against error, at {} × {}", SIZE.x, SIZE.y));
        if let Some(why) = present.missing {
            ui.weak(why);
            return;
        }
        ui.horizontal(|ui| {
            let traced = self.truth.is_some();
            let text =
                if traced { "Trace this view again" } else { "Trace the truth of this view" };
            let ready = !self.tracing && present.is_loaded;
            if ui.add_enabled(ready, egui::Button::new(text)).clicked() {
                commands.push(Command::Trace);
            }
            if self.tracing {
                ui.spinner();
                ui.label("tracing");
            }
        });
        if self.truth.is_none() {
            ui.weak("Each of your settings then becomes a point: its time, and its mean FLIP to the truth.");
            return;
        }
        if !present.is_traced {
            ui.weak("View or liquid have changed: trace the truth again to measure here.");
        }
        let plot = Plot::new("error")
            .height(200.0)
            .include_x(0.0)
            .include_y(0.0)
            .allow_scroll(false)
            .x_axis_label("ms")
            .y_axis_label("mean FLIP");
        plot.show(ui, |plot| {
            for point in &self.points {
                let now = point.settings == *present.settings;
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
        if let Some(point) = self.points.iter().find(|point| point.settings == *present.settings) {
            let Point { ms, flip, .. } = point;
            ui.monospace(format!("these settings: {ms:.1} ms, FLIP {flip:.4}"));
        }
        if ui.small_button("Forget the points").clicked() {
            self.points.clear();
        }
    }
}
