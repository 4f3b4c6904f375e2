//! Colours by an attribute of the particles: which, by which map, and over which range.

mod ranges;

use std::fmt;
use std::str::FromStr;

use glam::{DMat3, DVec3, Vec3};
use limpid::liquid::classify::Splats;
use limpid::liquid::{ColorMap, Colors, Particles};
use limpid::mesh::linear_from_srgb;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
#[cfg(doc)]
use crate::particles::ReadOptions;
use crate::particles::shown::{COLOR, is_color};

pub use self::ranges::AttributeRange;

/// An attribute that colours particles: `liquid.color_by` in a scene file, its name there.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(from = "String", into = "String")]
pub enum Attribute {
    /// Speed: the length of the velocity.
    Velocity,
    /// Mass density.
    Density,
    /// Radius of the particle.
    Radius,
    /// Number that persists between frames: a category.
    Id,
    /// Number of the scene's fluid, from 1: a category.
    Fluid,
    /// Colours of the particles' own: see [`ReadOptions::shown`].
    Color,
    /// A scalar of the file, or the length of a vector, by the name of its array.
    Other(String),
}

impl Attribute {
    /// Its name.
    pub fn name(&self) -> &str {
        match self {
            Self::Velocity => "velocity",
            Self::Density => "density",
            Self::Radius => "radius",
            Self::Id => "id",
            Self::Fluid => "fluid",
            Self::Color => COLOR,
            Self::Other(name) => name,
        }
    }

    /// Unit of its values, if that is the same in all files; empty without one.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::Velocity => "m/s",
            Self::Density => "kg/m³",
            Self::Radius => "m",
            Self::Id | Self::Fluid | Self::Color | Self::Other(_) => "",
        }
    }

    /// Whether a colour map shows it.
    pub fn is_mapped(&self) -> bool {
        !matches!(self, Self::Id | Self::Fluid | Self::Color)
    }

    /// The attribute that readers are to keep for it: [`ReadOptions::shown`].
    pub fn of_files(&self) -> Option<String> {
        (*self != Self::Fluid).then(|| self.name().to_owned())
    }

    /// The attributes that these particles have.
    pub fn of(particles: &Particles) -> Vec<Self> {
        let all = [Self::Velocity, Self::Density, Self::Radius, Self::Id, Self::Fluid, Self::Color];
        all.into_iter().filter(|attribute| attribute.values(particles).is_some()).collect()
    }

    /// The values of particles, if they have them. Those of another attribute are [`Particles::values`].
    pub fn values(&self, particles: &Particles) -> Option<Values> {
        let Particles { velocities, densities, radii, ids, fluids, values, colors, .. } = particles;
        Some(match self {
            Self::Velocity => {
                Values::Scalars(velocities.as_ref()?.iter().map(|v| v.length()).collect())
            }
            Self::Density => Values::Scalars(densities.clone()?),
            Self::Radius => Values::Scalars(radii.clone()?),
            Self::Id => Values::Categories(ids.as_ref()?.iter().map(|&id| id as u64).collect()),
            Self::Fluid => {
                Values::Categories(fluids.as_ref()?.iter().map(|&fluid| fluid.into()).collect())
            }
            // A file may have one number of this name.
            Self::Color => match colors {
                Some(colors) => Values::Colors(colors.clone()),
                None => Values::Scalars(values.clone()?),
            },
            Self::Other(_) => Values::Scalars(values.clone()?),
        })
    }
}

impl From<&str> for Attribute {
    /// The attribute of a name, in any case.
    fn from(name: &str) -> Self {
        let name = name.trim();
        match name.to_ascii_lowercase().as_str() {
            "velocity" => Self::Velocity,
            "density" => Self::Density,
            "radius" => Self::Radius,
            "id" => Self::Id,
            "fluid" => Self::Fluid,
            lower if is_color(lower) => Self::Color,
            _ => Self::Other(name.to_owned()),
        }
    }
}

impl From<String> for Attribute {
    fn from(name: String) -> Self {
        name.as_str().into()
    }
}

impl From<Attribute> for String {
    fn from(attribute: Attribute) -> Self {
        attribute.name().to_owned()
    }
}

impl fmt::Display for Attribute {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Values of an attribute, one a particle.
#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Numbers between which there are others.
    Scalars(Vec<f32>),
    /// Numbers that only tell particles apart.
    Categories(Vec<u64>),
    /// Colours, linear RGB.
    Colors(Vec<Vec3>),
}

impl Values {
    /// The values as numbers, if they are some.
    pub fn scalars(self) -> Option<Vec<f32>> {
        match self {
            Self::Scalars(values) => Some(values),
            Self::Categories(numbers) => Some(numbers.iter().map(|&n| n as i64 as f32).collect()),
            Self::Colors(_) => None,
        }
    }
}

/// A colour map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[expect(missing_docs, reason = "names that are known")]
pub enum MapName {
    #[default]
    Viridis,
    Plasma,
    Inferno,
    Magma,
    Cividis,
    Turbo,
    /// Blue over grey to red (K. Moreland, Diverging Color Maps for Scientific Visualization, 2009).
    Coolwarm,
    Spectral,
    Greys,
}

impl MapName {
    /// All maps.
    pub const ALL: [Self; 9] = [
        Self::Viridis,
        Self::Plasma,
        Self::Inferno,
        Self::Magma,
        Self::Cividis,
        Self::Turbo,
        Self::Coolwarm,
        Self::Spectral,
        Self::Greys,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Viridis => "viridis",
            Self::Plasma => "plasma",
            Self::Inferno => "inferno",
            Self::Magma => "magma",
            Self::Cividis => "cividis",
            Self::Turbo => "turbo",
            Self::Coolwarm => "coolwarm",
            Self::Spectral => "spectral",
            Self::Greys => "greys",
        }
    }

    /// The colour at a place from 0 to 1, sRGB.
    pub fn srgb(self, place: f64) -> [u8; 3] {
        let gradient = match self {
            Self::Viridis => colorous::VIRIDIS,
            Self::Plasma => colorous::PLASMA,
            Self::Inferno => colorous::INFERNO,
            Self::Magma => colorous::MAGMA,
            Self::Cividis => colorous::CIVIDIS,
            Self::Turbo => colorous::TURBO,
            Self::Spectral => colorous::SPECTRAL,
            Self::Greys => colorous::GREYS,
            Self::Coolwarm => return coolwarm(place.clamp(0.0, 1.0)),
        };
        gradient.eval_continuous(place.clamp(0.0, 1.0)).into_array()
    }

    /// The map over a range.
    pub fn over(self, range: [f32; 2]) -> ColorMap {
        const STEPS: u32 = 256;
        let color = |i| linear(self.srgb(f64::from(i) / f64::from(STEPS - 1)));
        ColorMap { colors: (0..STEPS).map(color).collect(), range }
    }
}

impl fmt::Display for MapName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for MapName {
    type Err = String;

    /// The map of a name, in any case.
    fn from_str(text: &str) -> Result<Self, String> {
        const SIMILAR: f64 = 0.75;
        let wanted = text.trim().to_ascii_lowercase();
        Self::ALL.into_iter().find(|map| map.name() == wanted).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            let likeness = |map: &Self| strsim::jaro_winkler(map.name(), &wanted);
            let nearest = Self::ALL.into_iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
            let nearest = nearest.filter(|map| likeness(map) > SIMILAR);
            let meant = nearest.map_or(String::new(), |map| format!(" (is it {map}?)"));
            format!("there is no color map {text}{meant}; there are {known}")
        })
    }
}

fn linear(color: [u8; 3]) -> Vec3 {
    Vec3::from_array(color.map(|c| linear_from_srgb(f32::from(c) / 255.0)))
}

/// Moreland's diverging map between (59, 76, 192) and (180, 4, 38): straight lines in polar CIELAB from both to a grey.
fn coolwarm(place: f64) -> [u8; 3] {
    /// Lightness, saturation and hue angle of the ends and, with the hue of either side, of the middle.
    const COLD: DVec3 = DVec3::new(80.0, 1.08, -1.1);
    const WARM: DVec3 = DVec3::new(80.0, 1.08, 0.5);
    const WHITE: DVec3 = DVec3::new(88.0, 0.0, 0.0);
    let end = if place < 0.5 { COLD } else { WARM };
    // How far the hue turns towards the unsaturated middle (equation 5).
    let turn = end.y * (WHITE.x * WHITE.x - end.x * end.x).max(0.0).sqrt() / (end.x * end.y.sin());
    let hue = if end.z > -std::f64::consts::FRAC_PI_3 { end.z + turn } else { end.z - turn };
    let msh = DVec3::new(WHITE.x, 0.0, hue).lerp(end, (2.0 * place - 1.0).abs());
    let lab = DVec3::new(
        msh.x * msh.y.cos(),
        msh.x * msh.y.sin() * msh.z.cos(),
        msh.x * msh.y.sin() * msh.z.sin(),
    );
    // To XYZ under D65, to linear RGB (IEC 61966-2-1), to sRGB.
    let y = (lab.x + 16.0) / 116.0;
    let f = DVec3::new(y + lab.y / 500.0, y, y - lab.z / 200.0);
    let xyz = f.map(|f| if f > 6.0 / 29.0 { f.powi(3) } else { (f - 16.0 / 116.0) / 7.787 });
    let xyz = xyz * DVec3::new(0.9505, 1.0, 1.089);
    let rgb_from_xyz = DMat3::from_cols_array(&[
        3.2406, -0.9689, 0.0557, -1.5372, 1.8758, -0.2040, -0.4986, 0.0415, 1.0570,
    ]);
    let srgb = |c: f64| {
        let c = c.clamp(0.0, 1.0);
        if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
    };
    (rgb_from_xyz * xyz).to_array().map(|c| (255.0 * srgb(c)).round() as u8)
}

/// The range of values that a colour map shows: `20:80` or `auto`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum ColorRange {
    /// The usual one of the whole sequence: [`crate::input::Loader::color_scale`].
    Auto,
    /// From one value to a larger one.
    Of([f32; 2]),
}

impl ColorRange {
    /// The range; `None` for the usual one.
    pub fn given(self) -> Option<[f32; 2]> {
        if let Self::Of(range) = self { Some(range) } else { None }
    }

    /// Whether two numbers are a range.
    pub fn rises([low, high]: [f32; 2]) -> bool {
        low.is_finite() && high.is_finite() && low < high
    }
}

impl fmt::Display for ColorRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Of([low, high]) => write!(f, "{low}:{high}"),
        }
    }
}

impl FromStr for ColorRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text.trim() == "auto" {
            return Ok(Self::Auto);
        }
        let ends = text.split_once(':').and_then(|(low, high)| {
            let number = |text: &str| text.trim().parse::<f32>().ok();
            Some([number(low)?, number(high)?])
        });
        let range = ends.filter(|ends| Self::rises(*ends)).map(Self::Of);
        range.ok_or_else(|| "expected LOW:HIGH, the smaller one first, as 20:80; or auto".into())
    }
}

/// Colours by an attribute.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ColorBy {
    /// The attribute.
    pub attribute: Attribute,
    /// The map of its values; categories have ten colours of their own.
    pub map: MapName,
    /// Values of the map's first and last colour; `None` for the usual ones of the sequence.
    pub range: Option<[f32; 2]>,
}

impl ColorBy {
    /// Colours by an attribute, with the default map over the usual range.
    pub fn new(attribute: Attribute) -> Self {
        Self { attribute, map: MapName::default(), range: None }
    }

    /// The colours of particles with these splats; `range` is that of values if the user gave none.
    ///
    /// # Errors
    /// [`Error::Usage`] if the particles lack the attribute, naming those that they have.
    pub fn colors(
        &self,
        particles: &Particles,
        default_radius: f32,
        splats: &Splats,
        range: [f32; 2],
    ) -> Result<Colors> {
        // The first frames of many emitters have no particles, and no attributes.
        let values = match self.attribute.values(particles) {
            None if particles.is_empty() => Values::Scalars(Vec::new()),
            values => values.ok_or_else(|| self.missing(particles))?,
        };
        let given = |colors: &[Vec3]| Colors::given(particles, default_radius, splats, colors);
        Ok(match values {
            Values::Scalars(values) => {
                let map = self.map.over(self.range.unwrap_or(range));
                Colors::by_value(particles, default_radius, splats, &values, map)?
            }
            Values::Categories(numbers) => {
                let color = |number: &u64| {
                    let color = colorous::TABLEAU10[(number % 10) as usize];
                    linear(color.into_array())
                };
                given(&numbers.iter().map(color).collect::<Vec<_>>())?
            }
            Values::Colors(colors) => given(&colors)?,
        })
    }

    fn missing(&self, particles: &Particles) -> Error {
        let has = Attribute::of(particles);
        let has: Vec<_> = has.iter().map(Attribute::name).collect();
        let has = if has.is_empty() { "none".into() } else { has.join(", ") };
        Error::Usage(format!(
            "the particles have no {} to color by; they have {has}",
            self.attribute
        ))
    }
}

/// The colours of values, as a legend shows them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ColorScale {
    /// Name of the attribute.
    pub name: String,
    /// Unit of the values; empty if it is not known.
    pub unit: String,
    /// The map.
    pub map: MapName,
    /// Values of its first and last colour.
    pub range: [f32; 2],
    /// Whether the range is the usual one of the sequence.
    pub automatic: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ends and middles as their authors publish them.
    #[test]
    fn maps_have_their_known_colors() {
        for (map, place, color) in [
            (MapName::Viridis, 0.0, [68, 1, 84]),
            (MapName::Viridis, 1.0, [253, 231, 37]),
            (MapName::Coolwarm, 0.0, [59, 76, 192]),
            (MapName::Coolwarm, 0.5, [221, 221, 221]),
            (MapName::Coolwarm, 1.0, [180, 4, 38]),
        ] {
            let found = map.srgb(place);
            let off = found.iter().zip(color).map(|(a, b)| a.abs_diff(b)).max();
            assert!(off <= Some(2), "{map} at {place}: {found:?}, not {color:?}");
        }
        for map in MapName::ALL {
            assert_eq!(map.name().parse(), Ok(map));
        }
        assert_eq!("Greys".parse(), Ok(MapName::Greys));
        let problem = |name: &str| name.parse::<MapName>().unwrap_err();
        assert!(problem("jet").starts_with("there is no color map jet; there are viridis, plasma"));
        assert!(problem("virdis").contains("(is it viridis?)"));
    }

    /// Names are those of attributes in any case, and others those of arrays; ranges rise.
    #[test]
    fn names_and_ranges_are_parsed() {
        for (name, attribute) in [
            ("Velocity", Attribute::Velocity),
            ("Cd", Attribute::Color),
            ("color", Attribute::Color),
            ("Temperature", Attribute::Other("Temperature".into())),
        ] {
            assert_eq!(Attribute::from(name), attribute);
        }
        assert_eq!("-1.5:2e3".parse(), Ok(ColorRange::Of([-1.5, 2000.0])));
        assert_eq!("auto".parse(), Ok(ColorRange::Auto));
        for wrong in ["", "1", "2:1", "1:1", "nan:1", "0:inf", "a:b"] {
            assert!(wrong.parse::<ColorRange>().unwrap_err().contains("LOW:HIGH"), "{wrong}");
        }
    }

    /// A missing attribute is named with those that there are.
    #[test]
    fn missing_attributes_are_told() {
        let mut particles = Particles::from_positions(vec![Vec3::ZERO; 3]);
        particles.densities = Some(vec![1000.0; 3]);
        let by = ColorBy::new(Attribute::Velocity);
        let splats = Splats::default();
        let error = by.colors(&particles, 0.1, &splats, [0.0, 1.0]).unwrap_err().to_string();
        assert!(error.contains("no velocity") && error.ends_with("they have density"), "{error}");
        assert!(Attribute::Density.values(&particles).is_some());
    }
}
