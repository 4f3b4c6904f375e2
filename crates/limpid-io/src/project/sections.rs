//! The tables of a scene file, and what they say in the renderer's terms.

use std::path::{Path, PathBuf};

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::ParticleSource;
use super::solids::{Given, unit};
use crate::color_by::{Attribute, ColorBy, ColorRange, MapName};
use crate::error::{Error, Result};
use crate::media::MediumName;
use crate::particles::{AttributeMap, Selection};
use limpid::environment::{Environment, Glow, MAX_RADIANCE};
use limpid::liquid::Up;
use limpid::scene::{Kind, Liquid, Medium};
use limpid::settings::{Caustics, Classify, Layers, Preset, Refract, Settings, Smooth, Tonemap};

/// A `[background]`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BackgroundFile {
    pub(super) file: PathBuf,
}

#[derive(Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct LiquidFile {
    pub(super) ior: Option<f32>,
    pub(super) absorption: Option<Vec3>,
    pub(super) color: Option<Vec3>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) medium: Option<MediumName>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) scattering: Option<Vec3>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) anisotropy: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) kind: Option<KindFile>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) roughness: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) color_by: Option<Attribute>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) colormap: Option<MapName>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) color_range: Option<[f32; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) tint_thickness: Option<f64>,
}

/// `liquid.kind`.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum KindFile {
    Clear,
    Opaque,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FluidFile {
    pub(super) source: PathBuf,
    pub(super) frame: Option<i64>,
    pub(super) radius: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) up: Option<Up>,
    pub(super) fps: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) scale: Option<f64>,
    #[serde(default, skip_serializing_if = "AttributeMap::is_empty")]
    pub(super) map: AttributeMap,
    #[serde(default, skip_serializing_if = "Selection::is_automatic")]
    pub(super) select: Selection,
    pub(super) absorption: Option<Vec3>,
    pub(super) color: Option<Vec3>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) medium: Option<MediumName>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) scattering: Option<Vec3>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) anisotropy: Option<f32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) kind: Option<KindFile>,
}

/// The inside of one of several fluids.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Inside {
    Medium(Medium),
    /// Nothing that light reaches, below a surface of this colour.
    Opaque(Vec3),
}

impl Inside {
    /// The medium; that of the whole liquid for an opaque fluid, which the others cover.
    pub(super) fn medium(self, liquid: &Liquid) -> Medium {
        match self {
            Self::Medium(medium) => medium,
            Self::Opaque(_) => liquid.medium(),
        }
    }

    /// The colour of an opaque fluid.
    pub(super) fn color(self) -> Option<Vec3> {
        match self {
            Self::Medium(_) => None,
            Self::Opaque(color) => Some(color),
        }
    }
}

/// The colours of the opaque fluids among several.
pub(super) fn opaque_colors(
    fluids: &[Inside],
    liquid: &Liquid,
) -> Result<Vec<Option<Vec3>>, String> {
    let colors: Vec<_> = fluids.iter().map(|fluid| fluid.color()).collect();
    if colors.iter().all(Option::is_none) {
        return Ok(Vec::new());
    }
    if liquid.kind == Kind::Opaque {
        return Err("[[fluid]] kind: the whole [liquid] is opaque; give its particles colors by \
                    color_by = \"fluid\""
            .into());
    }
    if colors.iter().all(Option::is_some) {
        return Err("[[fluid]] kind: all fluids are opaque; write [liquid] kind = \"opaque\" and \
                    color_by = \"fluid\""
            .into());
    }
    Ok(colors)
}

#[derive(Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct SettingsFile {
    pub(super) preset: Option<Preset>,
    pub(super) classify: Classify,
    pub(super) layers: Layers,
    pub(super) smooth: Smooth,
    pub(super) refract: Refract,
    pub(super) caustics: Caustics,
    pub(super) tonemap: Tonemap,
}

#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EnvironmentFile {
    pub(super) radiance: Option<Vec3>,
    pub(super) gradient: Option<GradientFile>,
    pub(super) sky: Option<SkyFile>,
    pub(super) map: Option<PathBuf>,
    pub(super) scale: Option<f32>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GradientFile {
    pub(super) zenith: Vec3,
    pub(super) horizon: Vec3,
    pub(super) nadir: Option<Vec3>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SkyFile {
    pub(super) zenith: Vec3,
    pub(super) horizon: Vec3,
    pub(super) nadir: Option<Vec3>,
    #[serde(default)]
    pub(super) glow: Vec<GlowFile>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GlowFile {
    pub(super) direction: Vec3,
    pub(super) radiance: Vec3,
    pub(super) sharpness: f32,
}

/// Reads an environment map.
pub(super) type LoadMap = fn(&Path) -> Result<Environment>;

/// The absorption in a file, given directly or as the colour of white light after a metre.
pub(super) fn absorption(
    absorption: Option<Vec3>,
    color: Option<Vec3>,
) -> Result<Option<Vec3>, String> {
    match (absorption, color) {
        (Some(_), Some(_)) => Err("takes one of absorption and color".into()),
        (None, Some(color)) if color.cmpgt(Vec3::ZERO).all() && color.cmple(Vec3::ONE).all() => {
            Ok(Some(color.map(|c| (-c.ln()).max(0.0))))
        }
        (None, Some(_)) => Err("color must be above 0 and at most 1: what a metre leaves".into()),
        (absorption, None) => Ok(absorption),
    }
}

/// The medium in a file: one by name or `default`, with other coefficients where those are given.
fn medium(
    default: Medium,
    name: Option<MediumName>,
    absorption: Option<Vec3>,
    scattering: Option<Vec3>,
    anisotropy: Option<f32>,
) -> Medium {
    let medium = name.map_or(default, MediumName::medium);
    Medium {
        absorption: absorption.unwrap_or(medium.absorption),
        scattering: scattering.unwrap_or(medium.scattering),
        anisotropy: anisotropy.unwrap_or(medium.anisotropy),
    }
}

/// The scattering and the anisotropy of a medium that scatters.
fn turbidity(medium: Medium) -> (Option<Vec3>, Option<f32>) {
    let scatters = medium.scattering != Vec3::ZERO;
    (scatters.then_some(medium.scattering), scatters.then_some(medium.anisotropy))
}

impl LiquidFile {
    pub(super) fn of(liquid: &Liquid, by: Option<&ColorBy>) -> Self {
        let ior = Some(liquid.ior);
        let (scattering, anisotropy) = turbidity(liquid.medium());
        match liquid.kind {
            Kind::Clear => Self {
                ior,
                absorption: Some(liquid.absorption),
                scattering,
                anisotropy,
                ..Self::default()
            },
            Kind::Opaque => Self {
                ior,
                kind: Some(KindFile::Opaque),
                color: Some(liquid.color).filter(|_| by.is_none()),
                roughness: Some(liquid.roughness),
                color_by: by.map(|by| by.attribute.clone()),
                colormap: by.filter(|by| by.attribute.is_mapped()).map(|by| by.map),
                color_range: by.and_then(|by| by.range),
                ..Self::default()
            },
        }
    }

    /// A liquid and its colours with one key replaced. Keys that do not go with it are dropped.
    pub(super) fn replaced(
        liquid: &Liquid,
        by: Option<&ColorBy>,
        key: &str,
        value: toml::Value,
    ) -> Result<(Liquid, Option<ColorBy>), String> {
        let mut own = Self::of(liquid, by);
        if liquid.kind == Kind::Clear {
            // Either may be given first.
            own.scattering = Some(liquid.scattering);
            own.anisotropy = Some(liquid.anisotropy);
        }
        let mut table = toml::Table::try_from(own).map_err(|e| e.to_string())?;
        let kept: Option<&[&str]> = match key {
            "kind" => Some(&["ior"]),
            "color_by" => Some(&["kind", "ior", "roughness"]),
            "color" => Some(&["kind", "ior", "roughness", "scattering", "anisotropy"]),
            _ => None,
        };
        if let Some(kept) = kept {
            table.retain(|key, _| kept.contains(&key));
        }
        table.insert(key.to_owned(), value);
        let new: Self = table.try_into().map_err(|e: toml::de::Error| e.message().to_owned())?;
        let by = new.color_by()?;
        Ok((new.validated()?, by))
    }

    /// A medium by name.
    pub(super) fn named(medium: MediumName) -> Self {
        Self { medium: Some(medium), ..Self::default() }
    }

    /// The medium, if it has its own coefficients.
    pub(super) fn medium_alone(&self) -> Option<MediumName> {
        let given = self.absorption.is_some() || self.color.is_some() || self.scattering.is_some();
        self.medium.filter(|_| !given)
    }

    /// Whether it says nothing about absorption.
    pub(super) fn provides_no_medium(&self) -> bool {
        self.absorption.is_none() && self.color.is_none() && self.medium.is_none()
    }

    /// Data are shown by opaque bodies, unless it says otherwise.
    fn is_opaque(&self) -> bool {
        match self.kind {
            Some(kind) => matches!(kind, KindFile::Opaque),
            None => self.color_by.is_some(),
        }
    }

    /// The attribute that colours the particles.
    pub(super) fn color_by(&self) -> Result<Option<ColorBy>, String> {
        let Some(attribute) = self.color_by.clone() else {
            return match (self.colormap, self.color_range) {
                (None, None) => Ok(None),
                _ => Err("colormap and color_range need color_by".into()),
            };
        };
        if !self.is_opaque() {
            return Err("color_by colors opaque bodies: kind = \"opaque\"".into());
        }
        if self.color.is_some() {
            return Err("takes one of color and color_by".into());
        }
        if !attribute.is_mapped() && (self.colormap.is_some() || self.color_range.is_some()) {
            return Err(format!("{attribute} has no colormap and no color_range: leave them out"));
        }
        if self.color_range.is_some_and(|range| !ColorRange::rises(range)) {
            return Err("color_range must be two numbers, the smaller one first".into());
        }
        Ok(Some(ColorBy {
            attribute,
            map: self.colormap.unwrap_or_default(),
            range: self.color_range,
        }))
    }

    pub(super) fn validated(self) -> Result<Liquid, String> {
        let default = Liquid::default();
        if self.is_opaque() {
            if self.absorption.is_some() {
                return Err("an opaque body absorbs no light on its way; give its color".into());
            }
            if self.scattering.is_some() || self.anisotropy.is_some() || self.medium.is_some() {
                let problem = "an opaque body has no medium inside: leave out medium, scattering and \
                               anisotropy, or kind = \"opaque\"";
                return Err(problem.into());
            }
            return Ok(Liquid {
                kind: Kind::Opaque,
                ior: self.ior.unwrap_or(1.0),
                color: self.color.unwrap_or(default.color),
                roughness: self.roughness.unwrap_or(default.roughness),
                ..default
            });
        }
        if self.roughness.is_some() {
            return Err("roughness is of the coat of an opaque body: kind = \"opaque\"".into());
        }
        let absorption = absorption(self.absorption, self.color)?;
        let Self { medium: name, scattering, anisotropy, .. } = self;
        let medium = medium(default.medium(), name, absorption, scattering, anisotropy);
        let ior = self.ior.unwrap_or_else(|| name.map_or(default.ior, MediumName::ior));
        Ok(Liquid { ior, ..default }.with(medium))
    }
}

impl FluidFile {
    pub(super) fn of(source: &ParticleSource, inside: Inside) -> Self {
        let ParticleSource { source, frame, radius, up, fps, scale, map, select } = source.clone();
        let (absorption, (scattering, anisotropy)) = match inside {
            Inside::Medium(medium) => (Some(medium.absorption), turbidity(medium)),
            Inside::Opaque(_) => (None, (None, None)),
        };
        let (color, medium) = (inside.color(), None);
        let kind = color.map(|_| KindFile::Opaque);
        Self {
            source,
            frame,
            radius,
            up,
            fps,
            scale,
            map,
            select,
            absorption,
            color,
            medium,
            scattering,
            anisotropy,
            kind,
        }
    }

    pub(super) fn validated(self, default: Medium) -> Result<(ParticleSource, Inside), String> {
        let inside = match self.kind {
            Some(KindFile::Opaque) => self.opaque()?,
            _ => {
                let absorption = absorption(self.absorption, self.color)?;
                let Self { medium: name, scattering, anisotropy, .. } = self;
                Inside::Medium(medium(default, name, absorption, scattering, anisotropy))
            }
        };
        let Self { source, frame, radius, up, fps, scale, map, select, .. } = self;
        Ok((ParticleSource { source, frame, radius, up, fps, scale, map, select }, inside))
    }

    fn opaque(&self) -> Result<Inside, String> {
        let has_medium = self.absorption.is_some()
            || self.scattering.is_some()
            || self.anisotropy.is_some()
            || self.medium.is_some();
        if has_medium {
            let problem = "an opaque fluid has no medium inside: leave out absorption, medium, scattering and \
                           anisotropy, or kind = \"opaque\"";
            return Err(problem.into());
        }
        let color = self.color.unwrap_or(Liquid::default().color);
        if color.cmplt(Vec3::ZERO).any() || color.cmpgt(Vec3::ONE).any() || !color.is_finite() {
            return Err("color must be between 0 and 1".into());
        }
        Ok(Inside::Opaque(color))
    }
}

impl EnvironmentFile {
    pub(super) fn of(environment: &Environment, map: Option<&str>) -> Result<Self> {
        match *environment {
            Environment::Constant(radiance) => {
                Ok(Self { radiance: Some(radiance), ..Self::default() })
            }
            Environment::Gradient { zenith, horizon, nadir } => {
                let gradient = GradientFile { zenith, horizon, nadir: Some(nadir) };
                Ok(Self { gradient: Some(gradient), ..Self::default() })
            }
            Environment::Sky { zenith, horizon, nadir, glows } => {
                let lit = glows.iter().filter(|glow| glow.radiance != Vec3::ZERO);
                let glow = lit.map(|glow| GlowFile {
                    direction: glow.direction,
                    radiance: glow.radiance,
                    sharpness: glow.sharpness,
                });
                let sky = SkyFile { zenith, horizon, nadir: Some(nadir), glow: glow.collect() };
                Ok(Self { sky: Some(sky), ..Self::default() })
            }
            Environment::Map { .. } => {
                let problem = || Error::Usage("an environment map needs a file of its own".into());
                Ok(Self { map: Some(map.ok_or_else(problem)?.into()), ..Self::default() })
            }
        }
    }

    pub(super) fn validated(
        self,
        folder: &Path,
        load_map: LoadMap,
        given: &[(PathBuf, Environment)],
        fail: &dyn Fn(String) -> Error,
    ) -> Result<Environment> {
        let scale = self.scale.unwrap_or(1.0);
        if !(scale >= 0.0 && scale.is_finite()) {
            return Err(fail("[environment] scale must not be negative".into()));
        }
        let environment = match (self.radiance, self.gradient, self.sky, self.map) {
            (None, None, None, None) => Environment::default(),
            (Some(radiance), None, None, None) => Environment::Constant(radiance),
            (None, Some(g), None, None) => Environment::Gradient {
                zenith: g.zenith,
                horizon: g.horizon,
                nadir: g.nadir.unwrap_or(g.horizon),
            },
            (None, None, Some(sky), None) => {
                sky.validated().map_err(|e| fail(format!("[environment] sky: {e}")))?
            }
            (None, None, None, Some(map)) => match Given::find(given, &map) {
                Some(map) => map.clone(),
                None => load_map(&folder.join(map))?,
            },
            _ => {
                let problem = "[environment] takes one of radiance, gradient, sky and map";
                return Err(fail(problem.into()));
            }
        };
        let environment = environment.scaled(scale);
        match &environment {
            Environment::Map { pixels, .. }
                if pixels.iter().flatten().any(|&c| c > MAX_RADIANCE) =>
            {
                Err(fail("[environment] scale makes the map brighter than 1e12".into()))
            }
            _ => Ok(environment),
        }
    }
}

impl SkyFile {
    pub(super) fn validated(self) -> Result<Environment, String> {
        let mut glows = [Glow::NONE; 2];
        if self.glow.len() > glows.len() {
            return Err(format!("has {} glows, expected at most {}", self.glow.len(), glows.len()));
        }
        for (glow, file) in glows.iter_mut().zip(self.glow) {
            let direction = unit(file.direction).ok_or("a glow's direction must not be zero")?;
            *glow = Glow { direction, radiance: file.radiance, sharpness: file.sharpness };
        }
        let Self { zenith, horizon, nadir, .. } = self;
        Ok(Environment::Sky { zenith, horizon, nadir: nadir.unwrap_or(horizon), glows })
    }
}

impl SettingsFile {
    pub(super) fn of(settings: &Settings) -> Self {
        let Settings { classify, layers, smooth, refract, caustics, tonemap } = settings.clone();
        Self { preset: None, classify, layers, smooth, refract, caustics, tonemap }
    }

    /// The settings of the file; those that it does not have are the preset's. `file` tells which keys were given.
    pub(super) fn validated(self, file: &toml::Table) -> Result<Settings, toml::de::Error> {
        let Self { preset, classify, layers, smooth, refract, caustics, tonemap } = self;
        let Some(preset) = preset else {
            return Ok(Settings { classify, layers, smooth, refract, caustics, tonemap });
        };
        let given = file.get("settings").and_then(toml::Value::as_table);
        overlaid(&preset.settings(), given.unwrap_or(&toml::Table::new()))
    }
}

/// Replaces the settings that a file's `[settings]` has.
pub(super) fn overlaid(
    settings: &Settings,
    file: &toml::Table,
) -> Result<Settings, toml::de::Error> {
    let mut all = toml::Table::try_from(settings).expect("settings are a table of tables");
    for (pass, settings) in &mut all {
        let given = file.get(pass).and_then(toml::Value::as_table);
        if let (Some(settings), Some(given)) = (settings.as_table_mut(), given) {
            settings.extend(given.clone());
        }
    }
    if let Some(classify) = all.get_mut("classify").and_then(toml::Value::as_table_mut) {
        classify.remove("on");
    }
    all.try_into()
}
