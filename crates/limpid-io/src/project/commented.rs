//! Scene files to edit: complete, in a readable order, with the meaning and the unit of each value.

use limpid::settings::Settings;

use super::Project;
use super::controls::{CONTROLS, table};
use crate::error::{Error, Result};

/// The sections of a scene file in the order in which they are written, with a comment for each.
const SECTIONS: [(&str, &str); 12] = [
    ("particles", "The particles: a file, a pattern such as frame_{}.bgeo, or a folder."),
    ("fluid", "The particles of one of several liquids."),
    ("recipe", "Particles generated from parameters."),
    ("simulation", "A simulation: `limpid bake` writes its frames."),
    ("liquid", "The optics of the liquid."),
    ("camera", "The view; without this section it is fitted to the particles."),
    ("view", "A further view, for reports."),
    ("environment", "Radiance of rays that hit nothing else, linear RGB."),
    ("background", "A picture behind everything."),
    (
        "solid",
        "A solid: shape = \"plane\", \"box\", \"sphere\" or \"mesh\"; color, checker, ground or texture.",
    ),
    ("rigid_bodies", "Solids of SPlisHSPlasH: rigid_bodies/rb_data_{}.bin."),
    ("light", "A light, which shines on solids with `lit = true`: sun or point."),
];

/// The meaning of keys, by section; an empty section stands for all.
const KEYS: [(&str, &str, &str); 36] = [
    ("particles", "radius", "m; for files without radii"),
    ("particles", "frame", "the frame that is drawn by default"),
    ("particles", "fps", "frames per second of the sequence"),
    ("particles", "scale", "length of the file's unit, m: 0.001 for millimetres"),
    ("", "up", "the axis that points up: y or z; of a camera, a vector"),
    (
        "",
        "up_axis",
        "the axis that points up where the camera counts, if not that of the particles' files",
    ),
    ("", "map", "arrays with other than the usual names: velocity=U,radius=h"),
    ("", "select", "which particles are read: type==1, mk in 1..3, or all"),
    ("liquid", "ior", "index of refraction: water 1.33, oil 1.47"),
    ("liquid", "tint_thickness", "m of liquid behind which particles' own colours are seen"),
    ("liquid", "absorption", "1/m for red, green and blue; or color = [r, g, b] after a metre"),
    ("camera", "eye", "m"),
    ("camera", "target", "m"),
    ("", "fov_y", "vertical field of view, degrees"),
    ("", "near", "near plane, m"),
    ("environment", "radiance", "the same in all directions"),
    ("environment.sky", "zenith", "straight up"),
    ("environment.sky", "horizon", ""),
    ("environment.sky", "nadir", "straight down"),
    ("environment.sky.glow", "direction", "towards its centre: the sun or a lamp"),
    ("environment.sky.glow", "radiance", "at its centre, added"),
    ("environment.sky.glow", "sharpness", "half as bright at about 67 degrees / sqrt(sharpness)"),
    ("environment.gradient", "zenith", "straight up"),
    ("environment.gradient", "nadir", "straight down"),
    ("solid", "origin", "m; a point of the plane, around which a ground fades"),
    ("solid", "half_extent", "m; half the side of a square; without it the plane is unbounded"),
    ("solid", "lit", "whether the colours are albedos under the lights"),
    ("solid.ground", "tile", "m"),
    ("solid.checker", "tile", "m"),
    ("solid.ground", "fade", "m from the origin, over which it fades into the horizon"),
    ("solid.key", "frame", "between keys, place and rotation are interpolated"),
    ("rigid_bodies", "walls", "whether walls are drawn too"),
    ("light.sun", "direction", "in which the light travels"),
    ("light.sun", "irradiance", "W/m2 on a surface that faces the sun"),
    ("light.point", "position", "m"),
    ("light.point", "intensity", "W/sr"),
];

impl Project {
    /// Writes the text of a scene file to edit, which [`Project::parse`] reads back as the same project:
    /// every section that it has, with comments, and the settings that differ from the defaults.
    ///
    /// # Errors
    /// As [`Project::to_toml`].
    pub fn to_commented_toml(&self, map: Option<&str>) -> Result<String> {
        let text = self.to_toml(map)?;
        let fail = |e: &dyn std::fmt::Display| Error::Usage(format!("the scene: {e}"));
        let mut file: toml::Table = text.parse().map_err(|e| fail(&e))?;
        let mut commented = String::from(
            "# A scene of limpid. Lengths are in metres, angles in degrees, y is up. Sections that are\n\
             # removed become automatic again if [environment] is removed too.\n",
        );
        for (name, comment) in SECTIONS {
            let Some(section) = file.remove(name) else { continue };
            if section.as_array().is_some_and(Vec::is_empty) {
                continue;
            }
            let mut alone = toml::Table::new();
            alone.insert(name.into(), section);
            let text = toml::to_string(&alone).map_err(|e| fail(&e))?;
            commented += &format!("\n# {comment}\n{}", with_meanings(&text));
        }
        let settings = changed(&self.scene.settings);
        commented += "\n# Settings that differ from the defaults; `limpid settings` lists all.\n";
        commented += &toml::to_string(&settings).map_err(|e| fail(&e))?;
        Ok(commented)
    }
}

/// The settings that differ from the defaults, as in a file.
fn changed(settings: &Settings) -> toml::Table {
    let (given, default) = (table(settings), table(&Settings::default()));
    let mut passes = toml::Table::new();
    for control in CONTROLS.iter().filter(|control| control.of(&given) != control.of(&default)) {
        let pass = passes.entry(control.pass).or_insert_with(|| toml::Table::new().into());
        let value = given[control.pass][control.key].clone();
        if let Some(pass) = pass.as_table_mut() {
            pass.insert(control.key.into(), value);
        }
    }
    let mut file = toml::Table::new();
    file.insert("settings".into(), passes.into());
    file
}

/// Adds the meaning of each key at the end of its line.
fn with_meanings(text: &str) -> String {
    let mut section = String::new();
    let mut commented = String::new();
    for line in text.lines() {
        if line.starts_with('[') {
            section = line.trim_matches(['[', ']']).to_owned();
        }
        let key = line.split_once(" = ").map_or("", |(key, _)| key);
        let meaning = KEYS.iter().find(|(of, name, meaning)| {
            *name == key && !meaning.is_empty() && (of.is_empty() || *of == section)
        });
        commented += line;
        if let Some((_, _, meaning)) = meaning {
            commented += &format!(" # {meaning}");
        }
        commented.push('\n');
    }
    commented
}
