//! Overrides: values of a project replaced by name, such as `refract.samples=4` or `liquid.ior=1.4`.

use glam::{DVec3, Vec3};
use serde::Deserialize as _;

use super::sections::LiquidFile;
use super::{Automatic, Project};
use crate::error::{Error, Result, toml_error};
use crate::shared_classifier::Processor;
use limpid::look::Body;
use limpid::scene::Medium;
use limpid::settings::{Preset, Settings};

impl Project {
    /// Replaces values, in order. A look does not provide them any more. Each override is one of
    ///
    /// - `pass.name=value`, one of the [`Settings`];
    /// - `preset=NAME`, all settings but those of caustics and tone mapping;
    /// - `liquid.ior=1.4`, `liquid.absorption=[1, 0.3, 0.1]`, `liquid.tint_thickness=0.2`;
    /// - `liquid.kind=opaque`, `liquid.scattering=[20, 20, 20]`, `liquid.color_by=density` and the other keys of `[liquid]`
    ///   except `medium`;
    /// - `fluid.2.absorption=[0, 0, 5]`, `scattering` or `anisotropy` of one of several fluids, counted from 1;
    /// - `classify.on=auto`, `cpu` or `gpu`: [`Processor`].
    ///
    /// # Errors
    /// [`Error::Override`] naming the override, and the nearest key for an unknown one.
    pub fn set(&mut self, overrides: &[String]) -> Result<()> {
        for text in overrides {
            let problem = self.set_one(text).err();
            if let Some(problem) = problem {
                return Err(Error::Override { text: text.clone(), problem });
            }
        }
        Ok(())
    }

    fn set_one(&mut self, text: &str) -> Result<(), String> {
        let (key, given) = split(text)?;
        if let Some(automatic) = &mut self.automatic {
            automatic.keep(key, &mut self.scene.settings);
        }
        let scene = &mut self.scene;
        match key.split('.').collect::<Vec<_>>()[..] {
            ["classify", "on"] => self.processor = processor(value(given))?,
            ["liquid", "ior"] => {
                scene.liquid.ior = number(given)?.try_into().map_err(|e| message(&e))?;
            }
            ["liquid", "absorption"] => {
                scene.liquid.absorption = vector(number(given)?).map_err(|e| message(&e))?;
            }
            ["liquid", "tint_thickness"] => {
                let length: f64 = number(given)?.try_into().map_err(|e| message(&e))?;
                if !(length > 0.0 && length.is_finite()) {
                    return Err("expected a length above 0 m".into());
                }
                self.tint_thickness = Some(length);
            }
            ["liquid", key] if LIQUID.contains(&key) => {
                let (by, value) = (self.color_by.as_ref(), value(given));
                check_count(&value, if key == "color_range" { 2 } else { 3 })?;
                (scene.liquid, self.color_by) =
                    LiquidFile::replaced(&scene.liquid, by, key, value)?;
            }
            ["fluid", number_from_1, key] if FLUID.contains(&key) => {
                let index = number_from_1.parse::<usize>().ok().and_then(|n| n.checked_sub(1));
                let count = scene.fluids.len();
                let fluid = index.and_then(|i| scene.fluids.get_mut(i));
                let problem = || format!("no fluid {number_from_1}; the scene has {count}");
                set_medium(fluid.ok_or_else(problem)?, key, number(given)?)
                    .map_err(|e| message(&e))?;
            }
            ["liquid" | "fluid", ..] => {
                let keys = LIQUID.map(|key| format!("liquid.{key}")).join(", ");
                let fluid = FLUID.map(|key| format!("fluid.N.{key}")).join(", ");
                return Err(format!("expected liquid.ior, liquid.absorption, {keys}, {fluid}"));
            }
            _ => scene.settings = with_one(&scene.settings, text)?,
        }
        Ok(())
    }
}

impl Automatic {
    /// Leaves a value to the scene, and with a setting those of its pass as the look has them.
    fn keep(&mut self, key: &str, settings: &mut Settings) {
        let own = || self.look.scene(&Body::filling(DVec3::ZERO, DVec3::ONE, 0.0)).settings;
        match key.split_once('.') {
            Some(("liquid", "ior" | "tint_thickness")) => {}
            Some(("liquid", _)) => (self.absorption, self.medium) = (false, None),
            Some(("caustics", _)) if self.caustics => {
                (settings.caustics, self.caustics) = (own().caustics, false);
            }
            Some(("tonemap", _)) if self.tonemap => {
                (settings.tonemap, self.tonemap) = (own().tonemap, false);
            }
            Some(("refract", "filter_patterns")) => self.patterns = false,
            _ => {}
        }
    }
}

/// Returns the settings with overrides applied, as by [`Project::set`].
///
/// # Errors
/// [`Error::Override`] naming the override, and the nearest key for an unknown one.
pub fn replaced(settings: &Settings, overrides: &[String]) -> Result<Settings> {
    let mut settings = settings.clone();
    for text in overrides {
        settings = with_one(&settings, text)
            .map_err(|problem| Error::Override { text: text.clone(), problem })?;
    }
    Ok(settings)
}

/// Finds a preset by name.
///
/// # Errors
/// [`Error::Usage`] naming the nearest preset for an unknown one.
pub fn preset(name: &str) -> Result<Preset> {
    toml::Value::from(name).try_into().map_err(|e| Error::Usage(problem_of(&e)))
}

/// Keys of `[liquid]` beside those of every kind.
const LIQUID: [&str; 8] = [
    "kind",
    "scattering",
    "anisotropy",
    "color",
    "roughness",
    "color_by",
    "colormap",
    "color_range",
];

/// Keys of a `[[fluid]]`.
const FLUID: [&str; 3] = ["absorption", "scattering", "anisotropy"];

/// The form of an override of a setting.
const EXPECTED: &str = "expected pass.name=value, as refract.samples=4";

fn with_one(settings: &Settings, text: &str) -> Result<Settings, String> {
    let (path, given) = split(text)?;
    if path == "preset" {
        let new = preset(given.trim().trim_matches('"')).map_err(|e| e.to_string())?.settings();
        let (caustics, tonemap) = (settings.caustics.clone(), settings.tonemap.clone());
        return Ok(Settings { caustics, tonemap, ..new });
    }
    let (pass, name) = path.split_once('.').ok_or(EXPECTED)?;
    let mut table = toml::Table::try_from(settings).map_err(|e| e.to_string())?;
    let pass = table
        .entry(pass)
        .or_insert_with(|| toml::Value::Table(toml::Table::new()))
        .as_table_mut()
        .ok_or(EXPECTED)?;
    // An integer is valid for a float.
    let value = match (pass.get(name), value(given)) {
        (Some(toml::Value::Float(_)), toml::Value::Integer(i)) => toml::Value::Float(i as f64),
        (_, value) => value,
    };
    pass.insert(name.to_owned(), value);
    let written = toml::to_string(&table).map_err(|e| e.to_string())?;
    toml::from_str(&written).map_err(|e| problem_of(&e))
}

fn split(text: &str) -> Result<(&str, &str), String> {
    let (path, value) = text.split_once('=').ok_or(EXPECTED)?;
    Ok((path.trim(), value))
}

fn toml_value(text: &str) -> Option<toml::Value> {
    format!("v = {text}").parse::<toml::Table>().ok().and_then(|mut table| table.remove("v"))
}

/// Parses a TOML value; a bare word is a string, so that `refract.solver=march` needs no quotes.
fn value(text: &str) -> toml::Value {
    toml_value(text).unwrap_or_else(|| toml::Value::String(text.trim().to_owned()))
}

fn number(text: &str) -> Result<toml::Value, String> {
    toml_value(text).ok_or_else(|| "expected a number or three in brackets".into())
}

fn vector(value: toml::Value) -> Result<Vec3, toml::de::Error> {
    check_count(&value, 3).map_err(serde::de::Error::custom)?;
    Ok(Vec3::from_array(value.try_into()?))
}

/// Fails if a value is another number of numbers: deserialization would silently use the first ones.
fn check_count(value: &toml::Value, expected: usize) -> Result<(), String> {
    match value.as_array().map(Vec::len).filter(|&count| count != expected) {
        Some(count) => Err(format!("expected {expected} numbers, found {count}")),
        None => Ok(()),
    }
}

fn set_medium(medium: &mut Medium, key: &str, value: toml::Value) -> Result<(), toml::de::Error> {
    match key {
        "absorption" => medium.absorption = vector(value)?,
        "scattering" => medium.scattering = vector(value)?,
        _ => medium.anisotropy = value.try_into()?,
    }
    Ok(())
}

fn processor(value: toml::Value) -> Result<Processor, String> {
    Processor::deserialize(value).map_err(|e| problem_of(&e))
}

fn message(error: &toml::de::Error) -> String {
    error.message().to_owned()
}

fn problem_of(error: &toml::de::Error) -> String {
    match toml_error("", "", error) {
        Error::Scene { problem, .. } => problem,
        other => other.to_string(),
    }
}
