//! The changes to a scene that people make most often, such as another look, sun or tint.

use std::fmt;
use std::str::FromStr;

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use crate::color_by::{Attribute, ColorBy, ColorRange, MapName};
use crate::error::{Error, Result};
use crate::floor::is_ground;
use crate::project::{Project, set_sky};
use limpid::liquid::Up;
use limpid::look::{Body, Look};
use limpid::scene::{Light, Liquid, Scene, Shape};

pub use crate::floor::Floor;
use crate::media::MediumName;

/// The changes to a scene that are made most often. Each replaces what the scene has.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Adjustments {
    /// The look: environment, lights and tone mapping, and, unless the scene has solids or an absorption
    /// of its own, the ground and the tint.
    pub look: Option<Look>,
    /// The look whose sky replaces the environment. A sun stays where it is.
    pub sky: Option<Look>,
    /// The sun; adds one to a scene without.
    pub sun: Option<Sun>,
    /// The unbounded level ground.
    pub floor: Option<Floor>,
    /// The index of refraction.
    pub ior: Option<f32>,
    /// The liquid's colour.
    pub tint: Option<Tint>,
    /// The attribute that colours the particles. It makes the liquid opaque, and without a scene or another look it picks
    /// [`Look::Paint`].
    pub color_by: Option<Attribute>,
    /// The map of its values.
    pub colormap: Option<MapName>,
    /// The range of the map.
    pub color_range: Option<ColorRange>,
    /// The medium. Its coefficients are scaled to the body as those of a look are.
    pub medium: Option<MediumName>,
    /// Whether the medium keeps its measured coefficients.
    #[serde(default)]
    pub physical: bool,
    /// The axis of the files that points up.
    pub up: Option<Up>,
    /// Length of the files' unit, m.
    pub scale: Option<f64>,
    /// Frames per second of the sequence.
    pub fps: Option<f64>,
}

/// The direction of the sun.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Sun {
    /// Without any.
    None,
    /// At an azimuth, degrees from +z towards +x, and an elevation, degrees above the horizon.
    At {
        /// Azimuth.
        azimuth: f64,
        /// Elevation, −90 to 90.
        elevation: f64,
    },
}

/// The colour of the liquid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Tint {
    /// Colour of water, whatever the liquid's size.
    Physical,
    /// None.
    Clear,
    /// The colour of white light behind the [thickness](Body::thickness) of the liquid.
    Color(Vec3),
}

impl Sun {
    /// The direction of a scene's first sun.
    pub fn of(scene: &Scene) -> Self {
        let mut suns = scene.lights.iter().filter_map(|light| match light {
            Light::Sun { direction, .. } => Some(-direction.as_dvec3().normalize_or(DVec3::NEG_Y)),
            _ => None,
        });
        suns.next().map_or(Self::None, |towards| Self::At {
            azimuth: towards.x.atan2(towards.z).to_degrees(),
            elevation: towards.y.clamp(-1.0, 1.0).asin().to_degrees(),
        })
    }

    /// Turns a scene's first sun, or adds one, with the sky's disc; or removes all suns.
    pub fn apply(self, scene: &mut Scene) {
        let is_sun = |light: &Light| matches!(light, Light::Sun { .. });
        let Self::At { azimuth, elevation } = self else {
            return scene.lights.retain(|light| !is_sun(light));
        };
        let (sin, cos) = azimuth.to_radians().sin_cos();
        let (up, level) = elevation.to_radians().sin_cos();
        let towards = DVec3::new(level * sin, up, level * cos).as_vec3();
        match scene.lights.iter_mut().find(|light| is_sun(light)) {
            Some(Light::Sun { direction, .. }) => *direction = -towards,
            _ => {
                let irradiance = Vec3::splat(3.0);
                scene.lights.push(Light::Sun { direction: -towards, irradiance });
            }
        }
        scene.environment.turn_sun(towards);
    }
}

impl fmt::Display for Sun {
    /// Writes the form that [`Sun::from_str`] parses.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::None => f.write_str("none"),
            Self::At { azimuth, elevation } => write!(f, "{azimuth},{elevation}"),
        }
    }
}

impl fmt::Display for Tint {
    /// Writes the form that [`Tint::from_str`] parses.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Physical => f.write_str("physical"),
            Self::Clear => f.write_str("clear"),
            Self::Color(c) => write!(f, "{},{},{}", c.x, c.y, c.z),
        }
    }
}

impl FromStr for Sun {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "none" {
            return Ok(Self::None);
        }
        let angles = text.split_once(',').and_then(|(a, e)| {
            let number = |text: &str| text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
            Some((number(a)?, number(e)?))
        });
        match angles {
            Some((azimuth, elevation)) if elevation.abs() <= 90.0 => {
                Ok(Self::At { azimuth, elevation })
            }
            _ => Err("expected AZIMUTH,ELEVATION in degrees, as 30,45, or none".into()),
        }
    }
}

impl FromStr for Tint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let color = || {
            let numbers: Option<Vec<f32>> =
                text.split(',').map(|c| c.trim().parse().ok()).collect();
            let [r, g, b] = numbers?.try_into().ok()?;
            let color = Vec3::new(r, g, b);
            (color.cmpgt(Vec3::ZERO).all() && color.cmple(Vec3::ONE).all()).then_some(color)
        };
        match text {
            "physical" => Ok(Self::Physical),
            "clear" => Ok(Self::Clear),
            _ => color().map(Self::Color).ok_or_else(|| {
                "expected R,G,B above 0 and at most 1, as 0.3,0.7,0.9; physical; or clear".into()
            }),
        }
    }
}

impl Adjustments {
    /// Names and values of the changes that decide the scene and the reading of its files.
    pub fn arguments(&self) -> Vec<(&'static str, String)> {
        let up = |up| if up == Up::Z { "z" } else { "y" };
        let arguments = [
            ("look", self.look.map(|look| look.name().to_owned())),
            ("sky", self.sky.map(|look| look.name().to_owned())),
            ("sun", self.sun.map(|sun| sun.to_string())),
            ("floor", self.floor.map(|floor| floor.to_string())),
            ("ior", self.ior.map(|ior| ior.to_string())),
            ("tint", self.tint.map(|tint| tint.to_string())),
            ("color-by", self.color_by.as_ref().map(ToString::to_string)),
            ("colormap", self.colormap.map(|map| map.to_string())),
            ("range", self.color_range.map(|range| range.to_string())),
            ("medium", self.medium.map(|medium| medium.to_string())),
            ("up", self.up.map(|axis| up(axis).to_owned())),
            ("scale", self.scale.map(|scale| scale.to_string())),
        ];
        arguments.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
    }

    /// Whether the changes depend on the body of liquid.
    pub(crate) fn need_body(&self) -> bool {
        let scaled = self.medium.is_some() && !self.physical;
        self.sky.is_some() || scaled || matches!(self.tint, Some(Tint::Color(_)))
    }

    /// Makes the liquid opaque if its look is paint or an attribute colours it, and sets the attribute, its map and its
    /// range.
    ///
    /// # Errors
    /// [`Error::Usage`] for a map or a range without an attribute that has one.
    fn color(&self, project: &mut Project) -> Result<()> {
        let is_paint = self.look == Some(Look::Paint) || self.color_by.is_some();
        if is_paint && !project.scene.is_opaque() {
            project.scene.liquid = Look::paint();
        }
        if let Some(attribute) = &self.color_by {
            project.color_by = Some(ColorBy::new(attribute.clone()));
        }
        if self.colormap.is_none() && self.color_range.is_none() {
            return Ok(());
        }
        let Some(by) = &mut project.color_by else {
            let problem =
                "a color map and a range show an attribute: name one to color by, as velocity";
            return Err(Error::Usage(problem.into()));
        };
        if !by.attribute.is_mapped() {
            let problem = format!(
                "{} has colors of its own: leave out the color map and the range",
                by.attribute
            );
            return Err(Error::Usage(problem));
        }
        by.map = self.colormap.unwrap_or(by.map);
        by.range = self.color_range.map_or(by.range, ColorRange::given);
        Ok(())
    }

    /// Changes the optics, the sky, the sun and the ground of a scene; a colour of the liquid and the lamps of a sky
    /// are relative to its body.
    ///
    /// # Errors
    /// [`Error::Usage`] for the height of a ground that the scene does not have.
    pub(crate) fn apply(&self, project: &mut Project, body: Option<&Body>) -> Result<()> {
        self.color(project)?;
        let Project { scene, motion, .. } = project;
        if let Some(medium) = self.medium {
            if scene.is_opaque() {
                let problem = "an opaque liquid shows no medium: leave out the medium, or the attribute, the look or the \
                               kind that makes it opaque";
                return Err(Error::Usage(problem.into()));
            }
            if !scene.fluids.is_empty() {
                let problem = "the scene has several fluids; give each [[fluid]] its medium";
                return Err(Error::Usage(problem.into()));
            }
            let thickness = body.filter(|_| !self.physical).map_or(1.0, Body::thickness);
            scene.liquid = medium.liquid(thickness as f32);
        }
        if let Some(ior) = self.ior {
            scene.liquid.ior = ior;
        }
        if let Some(tint) = self.tint.filter(|_| scene.is_opaque()) {
            scene.liquid.color = match tint {
                Tint::Color(_) if project.color_by.is_some() => {
                    let problem =
                        "a tint on a body that is colored by an attribute: give one of them";
                    return Err(Error::Usage(problem.into()));
                }
                Tint::Color(color) => color,
                tint => {
                    let problem = format!("{tint} is no color of an opaque body: give R,G,B");
                    return Err(Error::Usage(problem));
                }
            };
        } else if let Some(tint) = self.tint {
            let thickness = body.map_or(1.0, Body::thickness) as f32;
            scene.liquid.absorption = match tint {
                Tint::Physical => Liquid::default().absorption,
                Tint::Clear => Vec3::ZERO,
                Tint::Color(color) => color.map(|c| (-c.ln()).max(0.0)) / thickness,
            };
        }
        if let (Some(look), Some(body)) = (self.sky, body) {
            set_sky(scene, look, body);
        }
        if let Some(sun) = self.sun {
            sun.apply(scene);
        }
        match self.floor {
            None => {}
            Some(Floor::None) => {
                let kept: Vec<bool> = scene.solids.iter().map(|solid| !is_ground(solid)).collect();
                scene.solids.retain(|solid| !is_ground(solid));
                motion.retain(&kept);
            }
            Some(Floor::At(height)) => {
                let ground = scene.solids.iter_mut().find(|solid| is_ground(solid));
                let Some(Shape::Plane { origin, .. }) = ground.map(|ground| &mut ground.shape)
                else {
                    let problem =
                        "the scene has no unbounded level plane whose height could change";
                    return Err(Error::Usage(problem.into()));
                };
                origin.y = height;
            }
        }
        Ok(())
    }
}
