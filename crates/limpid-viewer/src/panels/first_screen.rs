//! The first screen: demos, and the sources that were opened last.

use std::path::Path;

use eframe::egui::{self, Rect, TextureOptions, vec2};

use crate::Viewer;
use crate::model::demos::{DEMOS, Demo};
use crate::model::document::Source;
use crate::model::shortcuts::Action;

/// Size of a demo's picture, points.
const PICTURE: egui::Vec2 = vec2(224.0, 140.0);

impl Viewer {
    /// Shows the first screen, or what is being opened.
    pub(crate) fn first_screen(&mut self, ui: &mut egui::Ui, rect: Rect) {
        ui.scope_builder(egui::UiBuilder::new().max_rect(rect), |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                ui.vertical_centered(|ui| {
                    let opening = self.opened.opening.as_ref().filter(|opening| opening.pending);
                    if let Some(opening) = opening {
                        ui.add_space(0.4 * rect.height());
                        ui.spinner();
                        ui.label(format!("opening {}", opening.source.input));
                        return;
                    }
                    ui.add_space((0.5 * rect.height() - 220.0).max(24.0));
                    ui.heading("Drop particle files, a folder or a scene here");
                    ui.add_space(6.0);
                    if ui.button("Open a file…").clicked() {
                        let ctx = ui.ctx().clone();
                        self.act(&ctx, Action::Open);
                    }
                    ui.add_space(28.0);
                    ui.weak("or look at a demo");
                    ui.add_space(8.0);
                    self.demos(ui, rect.width());
                    self.recent(ui);
                });
            });
        });
    }

    fn demos(&mut self, ui: &mut egui::Ui, width: f32) {
        if self.interface.demos.is_empty() {
            let ctx = ui.ctx();
            self.interface.demos = DEMOS.iter().map(|demo| texture(ctx, demo)).collect();
        }
        const GAP: f32 = 12.0;
        let card = PICTURE.x + GAP;
        let columns = ((width / card) as usize).clamp(1, DEMOS.len());
        let columns = if columns == 3 { 2 } else { columns };
        let mut chosen = None;
        let demos: Vec<_> = DEMOS.iter().zip(&self.interface.demos).collect();
        for row in demos.chunks(columns) {
            let size = vec2(row.len() as f32 * card - GAP, PICTURE.y + 46.0);
            ui.allocate_ui_with_layout(size, egui::Layout::left_to_right(egui::Align::Min), |ui| {
                ui.spacing_mut().item_spacing.x = GAP;
                for (demo, picture) in row {
                    ui.vertical(|ui| {
                        ui.set_width(PICTURE.x);
                        let image = egui::Image::new((picture.id(), PICTURE)).corner_radius(5);
                        let button = ui.add(egui::Button::image(image).frame(false));
                        button.widget_info(|| {
                            egui::WidgetInfo::labeled(egui::Role::Button, true, demo.title)
                        });
                        if button.on_hover_cursor(egui::CursorIcon::PointingHand).clicked() {
                            chosen = Some(*demo);
                        }
                        ui.strong(demo.title);
                        ui.small(demo.about);
                    });
                }
            });
            ui.add_space(8.0);
        }
        match chosen.map(Demo::source) {
            Some(Ok(source)) => self.open(source),
            Some(Err(error)) => self.fail(&error),
            None => {}
        }
    }

    fn recent(&mut self, ui: &mut egui::Ui) {
        if self.interface.recent.inputs().is_empty() {
            return;
        }
        ui.add_space(20.0);
        ui.weak("or what was open before");
        ui.add_space(4.0);
        let mut chosen = None;
        for input in self.interface.recent.inputs() {
            let path = Path::new(input);
            let name =
                path.file_name().map_or(input.as_str().into(), |name| name.to_string_lossy());
            if ui.link(name).on_hover_text(input).clicked() {
                chosen = Some(input.clone());
            }
        }
        if let Some(input) = chosen {
            self.open(Source::new(input));
        }
    }
}

fn texture(ctx: &egui::Context, demo: &Demo) -> egui::TextureHandle {
    let picture = image::load_from_memory(demo.picture).unwrap_or_default().into_rgb8();
    let size = [picture.width() as usize, picture.height() as usize];
    let image = egui::ColorImage::from_rgb(size, picture.as_raw());
    ctx.load_texture(demo.name, image, TextureOptions::LINEAR)
}
