//! The times panel: milliseconds per pass; below them, time against error (`error_plot.rs`).

use std::collections::VecDeque;

use eframe::egui;
use egui_plot::{Legend, Line, Plot, PlotPoints};

use limpid::gpu::PassTime;

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

    /// Each pass of the last picture with its time, ms.
    pub(crate) fn last(&self) -> impl Iterator<Item = (&'static str, f64)> {
        let last = |(name, series): &(&'static str, VecDeque<f64>)| Some((*name, *series.back()?));
        self.passes.iter().filter_map(last).filter(|(_, ms)| ms.is_finite())
    }

    /// Each pass with the mean of its recent times, ms.
    fn recent(&self) -> impl Iterator<Item = (&'static str, f64)> {
        self.passes.iter().filter_map(|(name, series)| {
            let recent = series.iter().rev().take(RECENT).filter(|ms| ms.is_finite());
            let (sum, count) = recent.fold((0.0, 0.0), |(sum, count), ms| (sum + ms, count + 1.0));
            (count > 0.0).then(|| (*name, sum / count))
        })
    }
    pub(crate) fn show(&self, ui: &mut egui::Ui) {
        ui.strong("Time per pass, ms; means of the last pictures");
        if self.passes.is_empty() {
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
                for (name, series) in &self.passes {
                    let first = self.pictures - series.len();
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
                    for (name, ms) in self.recent() {
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
    }
}
