//! The data that are open: their files, what is read of them, and what was guessed, which can be corrected.

use eframe::egui;
use glam::{DVec3, Vec3};
use limpid::liquid::Up;
use limpid::scene::Scene;
use limpid_io::input::Loaded;
use limpid_io::notice::{diffuse_counts, thousands};
use limpid_io::particles::Selection;

use crate::model::clip::{AXES, Clip};
use crate::model::document::Document;
use crate::model::platform::IN_BROWSER;
use crate::model::reading::Known;
use crate::panels::Command;
use crate::panels::layout::origin;
use crate::panels::sliders::{settled_number, settled_place, significant};
use crate::panels::toolbar::named;

/// Units of length by name, m.
const UNITS: [(&str, f64); 5] = [
    ("metres", 1.0),
    ("centimetres", 0.01),
    ("millimetres", 0.001),
    ("kilometres", 1e3),
    ("feet", 0.3048),
];

/// Least share of the light that a tint leaves.
const DARKEST: f32 = 1e-4;

/// The data that are shown.
pub(crate) struct DataRows<'a> {
    pub(crate) document: &'a Document,
    /// The frame that is shown, once it is loaded.
    pub(crate) loaded: Option<&'a Loaded>,
    /// The scene that is edited.
    pub(crate) scene: &'a mut Scene,
}

impl DataRows<'_> {
    pub(crate) fn show(self, ui: &mut egui::Ui, commands: &mut Vec<Command>) {
        let Self { document, loaded, scene } = self;
        text_row(ui, "Path", &document.source.input);
        if let [first, .., last] = document.numbers[..] {
            let count = document.numbers.len();
            text_row(ui, "Frames", &format!("{count}, numbered {first} to {last}"));
        }
        if let Some(loaded) = loaded {
            text_row(ui, "Particles", &thousands(loaded.particles));
            if let Some(counts) = diffuse_counts(loaded.diffuse_counts) {
                text_row(ui, "Whitewater", &counts);
            }
            fields_rows(ui, loaded);
            text_row(ui, "Extents", &extents(loaded, document.reading.up));
        }
        radius_row(ui, document, loaded, commands);
        if document.numbers.len() > 1 {
            rate_row(ui, document, commands);
        }
        if document.input.has_files() {
            up_row(ui, document, commands);
            unit_row(ui, document, commands);
        }
        // A page's worker is not told how files are read.
        if document.input.has_files() && !IN_BROWSER {
            clip_rows(ui, document, loaded, commands);
        }
        tint_row(ui, document, scene);
    }
}

/// The plane that cuts the liquid.
fn clip_rows(
    ui: &mut egui::Ui,
    document: &Document,
    loaded: Option<&Loaded>,
    commands: &mut Vec<Command>,
) {
    let hint = "Shows the particles on one side of a plane alone.\n--select";
    let select = &document.source.options.select;
    let now = Clip::of(select);
    // Another selection is the user's.
    if now.is_none() && !select.is_automatic() {
        return text_row(ui, "Selected", &select.to_string());
    }
    let label = ui.label("Clip").on_hover_text(hint);
    ui.horizontal(|ui| {
        let mut axis = now.map(|clip| clip.axis);
        let shown = axis.map_or("none", |axis| AXES[axis]);
        let choice = egui::ComboBox::from_id_salt("clip").width(56.0).selected_text(shown);
        let response = choice.show_ui(ui, |ui| {
            ui.selectable_value(&mut axis, None, "none");
            for (i, name) in AXES.into_iter().enumerate() {
                ui.selectable_value(&mut axis, Some(i), name);
            }
        });
        named(&response.response, "Clip");
        response.response.labelled_by(label.id).on_hover_text(hint);
        let mut clip = match (axis, now) {
            (None, None) => return,
            (None, Some(_)) => return commands.push(Command::Select(Selection::Automatic)),
            (Some(axis), Some(clip)) if clip.axis == axis => clip,
            (Some(axis), _) => Clip { axis, above: false, at: middle(document, loaded, axis) },
        };
        let (old, speed) = (clip.at, 0.005 * size_along(document, loaded, clip.axis));
        let typed = settled_place(ui, &label, clip.at, speed);
        clip.at = typed.unwrap_or(old);
        let side = if clip.above { "above" } else { "below" };
        if ui.button(side).on_hover_text("the side that is shown").clicked() {
            clip.above = !clip.above;
        }
        if Some(clip) != now {
            commands.push(Command::Select(clip.selection()));
        }
    });
    ui.end_row();
}

/// The middle of the liquid along an axis of the files, in their unit.
fn middle(document: &Document, loaded: Option<&Loaded>, axis: usize) -> f64 {
    let (min, max) = loaded.map(|loaded| loaded.bulk.bounds).unwrap_or_default();
    let middle = document.reading.up.from_y_up(0.5 * (min + max))[axis] / document.reading.scale;
    // A round number for the size of the liquid.
    let unit = 10f64.powf(size_along(document, loaded, axis).log10().floor() - 2.0);
    let round = (middle / unit).round() * unit + 0.0;
    significant(round).parse().unwrap_or(round)
}

/// The size of the liquid along an axis of the files, in their unit.
fn size_along(document: &Document, loaded: Option<&Loaded>, axis: usize) -> f64 {
    let (min, max) = loaded.map(|loaded| loaded.bulk.bounds).unwrap_or_default();
    (document.reading.up.from_y_up(max - min)[axis] / document.reading.scale).abs().max(1e-9)
}

fn text_row(ui: &mut egui::Ui, name: &str, text: &str) {
    ui.label(name);
    // Paths and lists of fields are long.
    ui.add(egui::Label::new(text).wrap_mode(egui::TextWrapMode::Wrap));
    ui.end_row();
}

/// The fields of the files that are used, and the others.
fn fields_rows(ui: &mut egui::Ui, loaded: &Loaded) {
    let used = loaded.arrays.iter().filter_map(|array| {
        let attribute = array.used_as?.name();
        let same = array.name.eq_ignore_ascii_case(attribute);
        Some(if same { array.name.clone() } else { format!("{} as {attribute}", array.name) })
    });
    let used: Vec<String> = ["position".to_owned()].into_iter().chain(used).collect();
    text_row(ui, "Fields used", &used.join(", "));
    let ignored = loaded.arrays.iter().filter(|array| array.used_as.is_none());
    let ignored: Vec<&str> = ignored.map(|array| array.name.as_str()).collect();
    if !ignored.is_empty() {
        text_row(ui, "Fields ignored", &ignored.join(", "));
    }
}

/// The size of the bulk along the axes of the files.
fn extents(loaded: &Loaded, up: Up) -> String {
    let (min, max) = loaded.bulk.bounds;
    let size = up.from_y_up(max - min).abs();
    let sizes = DVec3::to_array(&size).map(significant);
    format!("{} × {} × {} m", sizes[0], sizes[1], sizes[2])
}

fn radius_row(
    ui: &mut egui::Ui,
    document: &Document,
    loaded: Option<&Loaded>,
    commands: &mut Vec<Command>,
) {
    let hint = "Radius of the particles: half of the distance between them.\n--radius";
    let reading = &document.reading;
    let radius = loaded.map(|loaded| loaded.splats.radius).or(reading.radius);
    let Some(radius) = radius else { return };
    let known = loaded.map_or(reading.radius_known, |loaded| loaded.radius_from.into());
    let label = ui.label("Radius").on_hover_text(hint);
    ui.horizontal(|ui| {
        // Recipes and simulations have theirs, and so may files.
        if document.input.has_files() && known != Known::File {
            if let Some(typed) = settled_number(ui, &label, radius.into(), " m") {
                commands.push(Command::SetRadius(Some(typed as f32)));
            }
        } else {
            ui.label(format!("{} m", significant(radius.into())));
        }
        origin(ui, known);
        let given = document.source.radius.is_some();
        if given && ui.small_button("Forget").on_hover_text("the radius as before").clicked() {
            commands.push(Command::SetRadius(None));
        }
    });
    ui.end_row();
}

fn rate_row(ui: &mut egui::Ui, document: &Document, commands: &mut Vec<Command>) {
    let hint = "Frames per second of the sequence.\n--fps";
    let adjusted = &document.source.adjustments;
    let known = match (adjusted.fps, document.input.fps()) {
        (Some(_), _) => Known::Given,
        (None, Some(_)) if document.is_bare() => Known::File,
        (None, Some(_)) => Known::Scene,
        (None, None) => Known::Assumed,
    };
    let label = ui.label("Rate").on_hover_text(hint);
    ui.horizontal(|ui| {
        let typed = settled_number(ui, &label, document.fps(), " frames/s");
        if let Some(fps) = typed.filter(|fps| (1e-3..=1e6).contains(fps)) {
            let mut changed = adjusted.clone();
            changed.fps = Some(fps);
            commands.push(Command::Adjust(changed));
        }
        origin(ui, known);
    });
    ui.end_row();
}

fn up_row(ui: &mut egui::Ui, document: &Document, commands: &mut Vec<Command>) {
    let hint = "The axis of the files that points up.\n--up";
    let adjusted = &document.source.adjustments;
    let label = ui.label("Up").on_hover_text(hint);
    ui.horizontal(|ui| {
        let mut up = adjusted.up;
        let choice = egui::ComboBox::from_id_salt("up axis").width(56.0);
        let choice = choice.selected_text(document.reading.up.to_string());
        let response = choice.show_ui(ui, |ui| {
            for (option, name) in [(None, "automatic"), (Some(Up::Y), "y"), (Some(Up::Z), "z")] {
                ui.selectable_value(&mut up, option, name);
            }
        });
        named(&response.response, "Up");
        response.response.labelled_by(label.id).on_hover_text(hint);
        if up != adjusted.up {
            let mut changed = adjusted.clone();
            changed.up = up;
            commands.push(Command::Adjust(changed));
        }
        origin(ui, document.reading.up_known);
    });
    ui.end_row();
}

fn unit_row(ui: &mut egui::Ui, document: &Document, commands: &mut Vec<Command>) {
    let hint = "The unit of the files. It decides how strongly water absorbs; looks tint by the liquid's size.\n--scale";
    let adjusted = &document.source.adjustments;
    let label = ui.label("Unit").on_hover_text(hint);
    ui.horizontal(|ui| {
        let now = document.reading.scale;
        let known = UNITS.iter().find(|(_, scale)| *scale == now);
        let shown = known.map_or_else(|| format!("{now} m"), |(name, _)| (*name).to_owned());
        let mut scale = adjusted.scale;
        let choice = egui::ComboBox::from_id_salt("unit").selected_text(shown);
        let response = choice.show_ui(ui, |ui| {
            ui.selectable_value(&mut scale, None, "automatic");
            for (name, option) in UNITS {
                ui.selectable_value(&mut scale, Some(option), name);
            }
        });
        named(&response.response, "Unit");
        response.response.labelled_by(label.id).on_hover_text(hint);
        if scale != adjusted.scale {
            let mut changed = adjusted.clone();
            changed.scale = scale;
            commands.push(Command::Adjust(changed));
        }
        origin(
            ui,
            match adjusted.scale {
                Some(_) => Known::Given,
                None if document.is_bare() => Known::Assumed,
                None => Known::Scene,
            },
        );
    });
    ui.end_row();
}

/// The colour of white light behind the typical thickness of the liquid, where that is known.
fn tint_row(ui: &mut egui::Ui, document: &Document, scene: &mut Scene) {
    let Some(thickness) = document.thickness.filter(|thickness| *thickness > 0.0) else { return };
    if scene.is_opaque() || !scene.fluids.is_empty() {
        return;
    }
    let hint = "The color of white light behind the liquid.\n--tint, liquid.absorption";
    let label = ui.label("Tint").on_hover_text(hint);
    ui.horizontal(|ui| {
        let mut color = (-scene.liquid.absorption * thickness).exp().to_array();
        let button = ui.color_edit_button_rgb(&mut color).labelled_by(label.id);
        if button.on_hover_text(hint).changed() {
            let left = Vec3::from_array(color).clamp(Vec3::splat(DARKEST), Vec3::ONE);
            scene.liquid.absorption = left.map(|share| -share.ln() / thickness).max(Vec3::ZERO);
        }
        let adjusted = &document.source.adjustments;
        let opened = document.project.scene.liquid.absorption == scene.liquid.absorption;
        let given = adjusted.tint.is_some() || adjusted.medium.is_some() || !opened;
        match (given, document.is_bare()) {
            (true, _) => origin(ui, Known::Given),
            (false, false) => origin(ui, Known::Scene),
            (false, true) => _ = ui.weak("chosen by the liquid's size"),
        }
    });
    ui.end_row();
}
