//! The first screen: demos, and the sources that were opened last.

use eframe::egui::{self, Rect, TextureOptions, vec2};

use crate::model::demos::{DEMOS, Demo};
use crate::model::document::Source;
use crate::model::shortcuts::Action;
use crate::panels::Command;

/// Size of a demo's picture, points.
const PICTURE: egui::Vec2 = vec2(224.0, 140.0);

/// Contents of the first screen.
pub(crate) struct FirstScreen<'a> {
    /// The source that is being opened.
    pub(crate) opening: Option<&'a str>,
    /// The demos' pictures, once they have been shown.
    pub(crate) pictures: &'a mut Vec<egui::TextureHandle>,
    /// Names and sources of those that were opened last, the last one first.
    pub(crate) recent: Vec<(String, &'a str)>,
}

impl FirstScreen<'_> {
    pub(crate) fn show(self, ui: &mut egui::Ui, rect: Rect, commands: &mut Vec<Command>) {
        ui.scope_builder(egui::UiBuilder::new().max_rect(rect), |ui| {
            egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                ui.vertical_centered(|ui| {
                    if let Some(input) = self.opening {
                        ui.add_space(0.4 * rect.height());
                        ui.label(format!("opening {input}"));
                        return;
                    }
                    ui.add_space((0.5 * rect.height() - 220.0).max(24.0));
                    ui.heading("Drop particle files, a folder or a scene here");
                    ui.add_space(6.0);
                    if ui.button("Open a file…").clicked() {
                        commands.push(Command::Act(Action::Open));
                    }
                    if ui.button("Open a folder…").clicked() {
                        commands.push(Command::OpenFolder);
                    }
                    ui.add_space(28.0);
                    ui.weak("or look at a demo");
                    ui.add_space(8.0);
                    demos(ui, rect.width(), self.pictures, commands);
                    recent(ui, &self.recent, commands);
                });
            });
        });
    }
}

fn demos(
    ui: &mut egui::Ui,
    width: f32,
    pictures: &mut Vec<egui::TextureHandle>,
    commands: &mut Vec<Command>,
) {
    let pictures = self::pictures(ui.ctx(), pictures);
    const GAP: f32 = 12.0;
    let card = PICTURE.x + GAP;
    let columns = ((width / card) as usize).clamp(1, DEMOS.len());
    let columns = if columns == 3 { 2 } else { columns };
    let demos: Vec<_> = DEMOS.iter().zip(pictures).collect();
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
                        commands.push(Command::OpenDemo(demo));
                    }
                    ui.strong(demo.title);
                    ui.small(demo.about);
                });
            }
        });
        ui.add_space(8.0);
    }
}

fn recent(ui: &mut egui::Ui, inputs: &[(String, &str)], commands: &mut Vec<Command>) {
    if inputs.is_empty() {
        return;
    }
    ui.add_space(20.0);
    ui.weak("or what was open before");
    ui.add_space(4.0);
    for (name, input) in inputs {
        if ui.link(name.as_str()).on_hover_text(*input).clicked() {
            commands.push(Command::Open(Source::new(*input)));
        }
    }
}

/// Says in a corner of the picture that it takes files.
pub(crate) fn invite(ui: &egui::Ui, rect: Rect, commands: &mut Vec<Command>) {
    let corner = rect.left_bottom() + vec2(12.0, -12.0);
    let area = egui::Area::new(ui.scope_id().with("invitation")).fixed_pos(corner);
    area.pivot(egui::Align2::LEFT_BOTTOM).show(ui.ctx(), |ui| {
        let text = egui::RichText::new("Drop particle files here, or open them").small();
        let button = egui::Button::new(text).fill(egui::Color32::from_black_alpha(120));
        if ui.add(button.wrap_mode(egui::TextWrapMode::Extend)).clicked() {
            commands.push(Command::Act(Action::Open));
        }
    });
}

/// The demos' pictures, which are decoded once.
pub(crate) fn pictures<'a>(
    ctx: &egui::Context,
    known: &'a mut Vec<egui::TextureHandle>,
) -> &'a [egui::TextureHandle] {
    if known.is_empty() {
        *known = DEMOS.iter().map(|demo| texture(ctx, demo)).collect();
    }
    known
}

fn texture(ctx: &egui::Context, demo: &Demo) -> egui::TextureHandle {
    let picture = image::load_from_memory(demo.picture).unwrap_or_default().into_rgb8();
    let size = [picture.width() as usize, picture.height() as usize];
    let image = egui::ColorImage::from_rgb(size, picture.as_raw());
    ctx.load_texture(demo.name, image, TextureOptions::LINEAR)
}
