//! Overrides: values of a project replaced by name, such as `refract.samples=4` or `liquid.ior=1.4`.

use glam::Vec3;
use serde::Deserialize as _;

use super::Project;
use super::sections::LiquidFile;
use crate::error::{Error, Result, toml_error};
use crate::shared_classifier::Processor;
use limpid::settings::{Preset, Settings};

impl Project {
    /// Replaces values, in order. Each override is one of
    ///
    /// - `pass.name=value`, one of the [`Settings`];
    /// - `preset=NAME`, all settings but those of caustics and tone mapping;
    /// - `liquid.ior=1.4`, `liquid.absorption=[1, 0.3, 0.1]`;
    /// - `liquid.kind=opaque`, `liquid.color=[0.5, 0.1, 0]`, `liquid.color_by=density` and the other keys of `[liquid]`;
    /// - `fluid.2.absorption=[0, 0, 5]`, one of several fluids, counted from 1;
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
        let scene = &mut self.scene;
        match key.split('.').collect::<Vec<_>>()[..] {
            ["classify", "on"] => self.processor = processor(value(given))?,
            ["liquid", "ior"] => {
                scene.liquid.ior = number(given)?.try_into().map_err(|e| message(&e))?;
            }
            ["liquid", "absorption"] => {
                scene.liquid.absorption = vector(number(given)?).map_err(|e| message(&e))?;
            }
            ["liquid", key] if LIQUID.contains(&key) => {
                let by = self.color_by.as_ref();
                (scene.liquid, self.color_by) =
                    LiquidFile::replaced(&scene.liquid, by, key, value(given))?;
            }
            ["fluid", number_from_1, "absorption"] => {
                let index = number_from_1.parse::<usize>().ok().and_then(|n| n.checked_sub(1));
                let count = scene.fluids.len();
                let fluid = index.and_then(|i| scene.fluids.get_mut(i));
                let problem = || format!("no fluid {number_from_1}; the scene has {count}");
                fluid.ok_or_else(problem)?.absorption =
                    vector(number(given)?).map_err(|e| message(&e))?;
            }
            ["liquid" | "fluid", ..] => {
                let keys = LIQUID.map(|key| format!("liquid.{key}")).join(", ");
                return Err(format!(
                    "expected liquid.ior, liquid.absorption, {keys} or fluid.N.absorption"
                ));
            }
            _ => scene.settings = with_one(&scene.settings, text)?,
        }
        Ok(())
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
const LIQUID: [&str; 6] = ["kind", "color", "roughness", "color_by", "colormap", "color_range"];

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
    // Deserialization would silently use the first three of more numbers.
    if let Some(count) = value.as_array().map(Vec::len).filter(|&count| count != 3) {
        return Err(serde::de::Error::custom(format!("expected 3 numbers, found {count}")));
    }
    Ok(Vec3::from_array(value.try_into()?))
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
