//! The overrides that turn one scene into another, to the bit: what a command or a link has to say.

use glam::Vec3;

use super::controls;
use crate::color_by::ColorBy;
use limpid::scene::{Kind, Liquid, Medium, Scene};

/// A scene, and the attribute that colours its particles.
pub type Colored<'a> = (&'a Scene, Option<&'a ColorBy>);

/// The overrides of all settings, the liquid, its colours and the fluids. Scenes that differ in other things do so
/// afterwards.
pub fn between((from, from_by): Colored<'_>, (to, to_by): Colored<'_>) -> Vec<String> {
    let settings = controls::differences(&from.settings, &to.settings).into_iter();
    let settings = settings.map(|(control, value)| format!("{}={value}", control.path()));
    let mut all: Vec<String> = settings.collect();
    let new = &to.liquid;
    let (mut old, mut by) = (from.liquid, from_by);
    if old.kind != new.kind {
        all.push(format!("liquid.kind={}", word(new.kind)));
        // It drops what the other kind has.
        old = Liquid { kind: new.kind, ior: old.ior, ..Liquid::default() };
        by = None;
    }
    if old.ior != new.ior {
        all.push(format!("liquid.ior={:?}", new.ior));
    }
    match new.kind {
        Kind::Clear => all.extend(of_medium("liquid", old.medium(), new.medium())),
        Kind::Opaque => {
            if old.roughness != new.roughness {
                all.push(format!("liquid.roughness={:?}", new.roughness));
            }
            match to_by {
                Some(to_by) => all.extend(of_colors(by, to_by)),
                None if by.is_some() || old.color != new.color => {
                    all.push(format!("liquid.color={}", vector(new.color)));
                }
                None => {}
            }
        }
    }
    for (number, (&old, &new)) in (1..).zip(from.fluids.iter().zip(&to.fluids)) {
        all.extend(of_medium(&format!("fluid.{number}"), old, new));
    }
    all
}

/// The word of a kind in a scene file.
fn word(kind: Kind) -> &'static str {
    match kind {
        Kind::Clear => "clear",
        Kind::Opaque => "opaque",
    }
}

fn of_medium(table: &str, old: Medium, new: Medium) -> Vec<String> {
    let mut all = Vec::new();
    if old.absorption != new.absorption {
        all.push(format!("{table}.absorption={}", vector(new.absorption)));
    }
    if old.scattering != new.scattering {
        all.push(format!("{table}.scattering={}", vector(new.scattering)));
    }
    if old.anisotropy != new.anisotropy {
        all.push(format!("{table}.anisotropy={:?}", new.anisotropy));
    }
    all
}

fn of_colors(old: Option<&ColorBy>, new: &ColorBy) -> Vec<String> {
    let mut all = Vec::new();
    let same = old.filter(|old| old.attribute == new.attribute);
    if same.is_none() {
        let name = toml::Value::String(new.attribute.to_string());
        all.push(format!("liquid.color_by={name}"));
    }
    let old = same.cloned().unwrap_or_else(|| ColorBy::new(new.attribute.clone()));
    if old.map != new.map {
        all.push(format!("liquid.colormap={}", new.map));
    }
    if let Some([low, high]) = new.range.filter(|_| old.range != new.range) {
        all.push(format!("liquid.color_range=[{low:?}, {high:?}]"));
    }
    all
}

fn vector(v: Vec3) -> String {
    format!("[{:?}, {:?}, {:?}]", v.x, v.y, v.z)
}
