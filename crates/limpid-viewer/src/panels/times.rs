//! The times panel: milliseconds per pass; below them, time against error (`error_plot.rs`).

use std::collections::VecDeque;

use eframe::egui::{self, Color32, Role, Sense, WidgetInfo, ecolor::Hsva, vec2};
use egui_plot::{Line, Plot, PlotPoints};

use limpid::gpu::PassTime;

/// Number of pictures in the plot.
const LENGTH: usize = 240;

/// Number of pictures that the table averages.
const RECENT: usize = 16;

/// Pass times of the last pictures.
#[derive(Debug, Default)]
pub(crate) struct Times {
    /// Times by pass, in the order of the passes; NaN for a picture without the pass.
    passes: Vec<(&'static str, VecDeque<f64>)>,
    pictures: usize,
    /// The place of the pass whose row the pointer is on.
    hovered: Option<usize>,
}

impl Times {
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

    /// Each recent pass with its place and the mean of its times, ms.
    fn recent(&self) -> impl Iterator<Item = (usize, &'static str, f64)> {
        self.passes.iter().enumerate().filter_map(|(i, (name, series))| {
            let recent = series.iter().rev().take(RECENT).filter(|ms| ms.is_finite());
            let (sum, count) = recent.fold((0.0, 0.0), |(sum, count), ms| (sum + ms, count + 1.0));
            (count > 0.0).then(|| (i, *name, sum / count))
        })
    }

    pub(crate) fn show(&mut self, ui: &mut egui::Ui) {
        ui.strong("Time per pass, ms; means of the last pictures");
        if self.passes.is_empty() {
            ui.weak("No times: the adapter measures none, or nothing has been drawn.");
            return;
        }
        self.plot(ui);
        let mut hovered = None;
        egui::Grid::new("means").num_columns(3).striped(true).show(ui, |ui| {
            let mut sum = 0.0;
            for (i, name, ms) in self.recent() {
                let (rect, swatch) = ui.allocate_exact_size(vec2(14.0, 14.0), Sense::hover());
                ui.painter().rect_filled(rect.shrink(2.0), 2, color(i));
                let named = || WidgetInfo::labeled(Role::Image, true, format!("Color of {name}"));
                swatch.widget_info(named);
                let row = swatch | ui.add(egui::Label::new(name).sense(Sense::hover()));
                let row = row | ui.monospace(format!("{ms:8.2}"));
                if row.hovered() {
                    hovered = Some(i);
                }
                ui.end_row();
                sum += ms;
            }
            ui.label("");
            ui.strong("all passes");
            ui.monospace(format!("{sum:8.2}"));
            ui.end_row();
        });
        self.hovered = hovered;
    }

    /// The times of the pictures. The table has the colours of the lines, because a legend would hide them.
    fn plot(&self, ui: &mut egui::Ui) {
        let plot = Plot::new("passes")
            .height(200.0)
            .include_y(0.0)
            .show_x(false)
            .allow_scroll(false)
            .allow_zoom(false)
            .allow_drag(false)
            .allow_boxed_zoom(false)
            .x_axis_label("pictures");
        plot.show(ui, |plot| {
            for (i, (name, series)) in self.passes.iter().enumerate() {
                let first = self.pictures - series.len();
                let points = series.iter().enumerate().filter(|(_, ms)| ms.is_finite());
                let points: PlotPoints<'_> =
                    points.map(|(i, &ms)| [(first + i) as f64, ms]).collect();
                let width = if self.hovered == Some(i) { 4.0 } else { 1.5 };
                plot.line(Line::new(*name, points).width(width).color(color(i)));
            }
        });
    }
}

/// The colour of a pass by its place: hues that are a golden section apart, so that no two of few dozens are alike.
fn color(i: usize) -> Color32 {
    const GOLDEN: f32 = 0.618_034;
    let lightness = [0.95, 0.7][i % 2];
    Hsva::new((0.55 + GOLDEN * i as f32).fract(), 0.7, lightness, 1.0).into()
}
