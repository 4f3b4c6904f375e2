//! The controls of the liquid: what kind it is, and its optics.

use eframe::egui;
use glam::Vec3;

use crate::model::document::Document;
use crate::panels::Command;
use crate::panels::sliders::number_slider;
use crate::panels::toolbar::named;
use limpid::look::Look;
use limpid::scene::{Liquid, MAX_ANISOTROPY, Medium, Scene};
use limpid::settings::{Kernel, Settings};
use limpid_io::adjustments::Adjustments;
use limpid_io::color_by::ColorBy;
use limpid_io::media::MediumName;

/// Optical depth of a body that becomes turbid.
const TURBID_DEPTH: f32 = 10.0;

/// The liquid's optics.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Sort {
    Clear,
    Turbid,
    Opaque,
    /// Each particle as an opaque ball.
    Particles,
}

impl Sort {
    const ALL: [Self; 4] = [Self::Clear, Self::Turbid, Self::Opaque, Self::Particles];

    fn of(scene: &Scene) -> Self {
        match (scene.is_opaque(), scene.is_turbid()) {
            (true, _) if is_of_balls(&scene.settings) => Self::Particles,
            (true, _) => Self::Opaque,
            (_, true) => Self::Turbid,
            _ => Self::Clear,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Clear => "clear",
            Self::Turbid => "turbid",
            Self::Opaque => "opaque",
            Self::Particles => "plain particles",
        }
    }

    /// Makes the liquid of a scene one of this sort, if it can as it was opened.
    fn apply(self, scene: &mut Scene, document: &Document) {
        let opened = &document.project.scene;
        if self == Self::Particles {
            scene.settings = of_balls(&scene.settings);
        } else if is_of_balls(&scene.settings) {
            scene.settings.classify.clone_from(&opened.settings.classify);
            scene.settings.smooth.clone_from(&opened.settings.smooth);
        }
        if matches!(self, Self::Opaque | Self::Particles) {
            let own = Some(opened.liquid).filter(|_| opened.is_opaque());
            scene.liquid = own.unwrap_or_else(Look::paint);
        } else if scene.is_opaque() {
            let own = Some(opened.liquid).filter(|_| !opened.is_opaque());
            scene.liquid = own.unwrap_or_default();
        }
        let turbid = self == Self::Turbid;
        let usual = Vec3::splat(TURBID_DEPTH / document.thickness.unwrap_or(1.0));
        let scattered = |medium: Medium, opened: Medium| {
            let Medium { scattering, anisotropy, .. } = opened;
            match turbid {
                false => Medium::clear(medium.absorption),
                true if scattering == Vec3::ZERO => Medium { scattering: usual, ..medium },
                true => Medium { scattering, anisotropy, ..medium },
            }
        };
        scene.liquid = scene.liquid.with(scattered(scene.liquid.medium(), opened.liquid.medium()));
        for (fluid, opened) in scene.fluids.iter_mut().zip(&opened.fluids) {
            *fluid = scattered(*fluid, *opened);
        }
    }
}

/// Settings by which each particle is drawn as a ball of its radius.
fn of_balls(settings: &Settings) -> Settings {
    let mut balls = settings.clone();
    let classify = &mut balls.classify;
    (classify.splash_density, classify.max_ratio, classify.smoothing) = (0.0, 1.0, 0.0);
    (classify.kernel, classify.iso_surface) = (Kernel::Volume, false);
    balls.smooth.iterations = 0;
    balls
}

fn is_of_balls(settings: &Settings) -> bool {
    *settings == of_balls(settings)
}

/// Rows for the kind of the liquid and its properties.
pub(crate) fn liquid_rows(
    ui: &mut egui::Ui,
    scene: &mut Scene,
    document: &Document,
    colors: Option<&ColorBy>,
    commands: &mut Vec<Command>,
) {
    let sort = Sort::of(scene);
    let hint = "Clear liquid refracts and absorbs light, turbid liquid scatters it inside, and opaque liquid shows its \
                surface alone; plain particles are balls.\nliquid.kind, liquid.scattering";
    let mut chosen = sort;
    let options = Sort::ALL.map(|sort| (sort, sort.name().to_owned()));
    choice(ui, "Kind", hint, &mut chosen, sort.name(), options);
    if chosen != sort {
        chosen.apply(scene, document);
    }
    let is_opaque = matches!(chosen, Sort::Opaque | Sort::Particles);
    if !is_opaque && scene.fluids.is_empty() {
        medium_row(ui, scene, document, commands);
    }
    let (hint, range) = match is_opaque {
        true => ("Of the coat: varnish 1.5, none 1.\n1 to 3\nliquid.ior", 1.0),
        false => {
            ("Water 1.33, glass 1.5, a bubble of air in water 0.75.\n0.3 to 3\nliquid.ior", 0.3)
        }
    };
    row(ui, "Refractive index", hint, |ui| {
        ui.add(number_slider(&mut scene.liquid.ior, range, 3.0))
    });
    if is_opaque {
        return opaque_rows(ui, &mut scene.liquid, colors);
    }
    let turbid = chosen == Sort::Turbid;
    if scene.fluids.is_empty() {
        let mut medium = scene.liquid.medium();
        medium_rows(ui, "", &mut medium, turbid);
        scene.liquid = scene.liquid.with(medium);
    }
    for (number, fluid) in (1..).zip(&mut scene.fluids) {
        medium_rows(ui, &format!(" {number}"), fluid, turbid);
    }
}

fn medium_row(
    ui: &mut egui::Ui,
    scene: &mut Scene,
    document: &Document,
    commands: &mut Vec<Command>,
) {
    let hint = "Measured coefficients; the body looks as one that is 1 m thick.\n--medium";
    let adjusted = &document.source.adjustments;
    // Without its size the liquid is opened again.
    let thickness = if adjusted.physical { Some(1.0) } else { document.thickness };
    let liquid_of = |medium: MediumName| Some(medium.liquid(thickness?));
    let is_it = |medium: &MediumName| liquid_of(*medium) == Some(scene.liquid);
    let now = MediumName::ALL.into_iter().find(is_it);
    let name = |medium: Option<MediumName>| {
        medium.map_or_else(|| "its own".to_owned(), |medium| medium.to_string())
    };
    let mut chosen = now;
    let options = MediumName::ALL.map(|medium| (Some(medium), medium.to_string()));
    choice(ui, "Medium", hint, &mut chosen, &name(now), options);
    if let Some(medium) = chosen.filter(|_| chosen != now) {
        match liquid_of(medium) {
            Some(liquid) => scene.liquid = liquid,
            None => {
                let (medium, tint) = (Some(medium), None);
                let changed = Adjustments { medium, tint, ..adjusted.clone() };
                commands.push(Command::Adjust(changed));
            }
        }
    }
}

fn opaque_rows(ui: &mut egui::Ui, liquid: &mut Liquid, colors: Option<&ColorBy>) {
    let hint = "How rough the coat is: 0 mirrors.\nliquid.roughness";
    row(ui, "Roughness", hint, |ui| ui.add(number_slider(&mut liquid.roughness, 0.0, 1.0)));
    if let Some(by) = colors {
        ui.label("Color");
        ui.weak(format!("by {}", by.attribute));
        ui.end_row();
        return;
    }
    let hint = "Share of the light that the body reflects, linear.\nliquid.color";
    channels(ui, "Color", hint, &mut liquid.color, (1.0, ""));
}

/// Rows for the coefficients of a medium, whose `name` follows those of the coefficients.
fn medium_rows(ui: &mut egui::Ui, name: &str, medium: &mut Medium, turbid: bool) {
    let hint = "What is left of the light after a metre is exp(−this).";
    channels(ui, &format!("Absorption{name}"), hint, &mut medium.absorption, (1000.0, " /m"));
    if !turbid {
        return;
    }
    let hint = "Light is scattered after 1 / this on average.\nliquid.scattering";
    channels(ui, &format!("Scattering{name}"), hint, &mut medium.scattering, (1e6, " /m"));
    let hint = "Mean cosine of the scattering angle: 1 goes straight on, 0 goes anywhere, −1 goes back.\n\
                liquid.anisotropy";
    let most = f64::from(MAX_ANISOTROPY);
    let slider = number_slider(&mut medium.anisotropy, -most, most);
    row(ui, &format!("Anisotropy{name}"), hint, |ui| ui.add(slider));
}

/// Rows for red, green and blue.
fn channels(
    ui: &mut egui::Ui,
    name: &str,
    hint: &str,
    color: &mut Vec3,
    (most, unit): (f64, &str),
) {
    for (axis, channel) in ["red", "green", "blue"].into_iter().enumerate() {
        let slider = number_slider(&mut color[axis], 0.0, most).suffix(unit);
        row(ui, &format!("{name}, {channel}"), hint, |ui| ui.add(slider));
    }
}

fn row(
    ui: &mut egui::Ui,
    name: &str,
    hint: &str,
    value: impl FnOnce(&mut egui::Ui) -> egui::Response,
) {
    let label = ui.label(name).on_hover_text(hint);
    value(ui).labelled_by(label.id).on_hover_text(hint);
    ui.end_row();
}

fn choice<T: PartialEq>(
    ui: &mut egui::Ui,
    name: &str,
    hint: &str,
    chosen: &mut T,
    shown: &str,
    options: impl IntoIterator<Item = (T, String)>,
) {
    let label = ui.label(name).on_hover_text(hint);
    let choice = egui::ComboBox::from_id_salt(name).selected_text(shown).height(400.0);
    let response = choice.show_ui(ui, |ui| {
        for (option, text) in options {
            ui.selectable_value(chosen, option, text);
        }
    });
    named(&response.response, name);
    response.response.labelled_by(label.id).on_hover_text(hint);
    ui.end_row();
}
