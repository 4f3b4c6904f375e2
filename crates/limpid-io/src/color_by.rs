//! Colours by an attribute of the particles: which, by which map, and over which range.

use std::fmt;
use std::str::FromStr;

use glam::{DMat3, DVec3, Vec3};
use limpid::liquid::classify::Splats;
use limpid::liquid::{ColorMap, Colors, Particles};
use limpid::mesh::linear_from_srgb;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// An attribute that colours particles: `liquid.color_by` in a scene file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
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
}

impl Attribute {
    /// All attributes.
    pub const ALL: [Self; 5] = [Self::Velocity, Self::Density, Self::Radius, Self::Id, Self::Fluid];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Velocity => "velocity",
            Self::Density => "density",
            Self::Radius => "radius",
            Self::Id => "id",
            Self::Fluid => "fluid",
        }
    }

    /// Unit of its values; empty without one.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Velocity => "m/s",
            Self::Density => "kg/m³",
            Self::Radius => "m",
            Self::Id | Self::Fluid => "",
        }
    }

    /// The attributes that these particles have.
    pub fn of(particles: &Particles) -> Vec<Self> {
        Self::ALL.into_iter().filter(|attribute| attribute.values(particles).is_some()).collect()
    }

    /// The values of particles, if they have them.
    pub fn values(self, particles: &Particles) -> Option<Values> {
        let Particles { velocities, densities, radii, ids, fluids, .. } = particles;
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
        })
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

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|map| map.name() == text).ok_or_else(|| {
            let known = Self::ALL.map(Self::name).join(", ");
            format!("there is no color map {text}; there are {known}")
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

/// Colours by an attribute.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ColorBy {
    /// The attribute.
    pub attribute: Attribute,
    /// The map of its values; categories have ten colours of their own.
    pub map: MapName,
    /// Values of the map's first and last colour; `None` for those of [`usual_range`].
    pub range: Option<[f32; 2]>,
}

impl ColorBy {
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
        let values = self.attribute.values(particles).ok_or_else(|| self.missing(particles))?;
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
                let colors: Vec<_> = numbers.iter().map(color).collect();
                Colors::given(particles, default_radius, splats, &colors)?
            }
        })
    }

    fn missing(&self, particles: &Particles) -> Error {
        let has: Vec<_> = Attribute::of(particles).into_iter().map(Attribute::name).collect();
        let has = if has.is_empty() { "none".into() } else { has.join(", ") };
        Error::Usage(format!(
            "the particles have no {} to color by; they have {has}",
            self.attribute
        ))
    }
}

/// The range of values in which pictures differ most: their 2nd to 98th percentile. `None` without finite values.
pub fn usual_range(mut values: Vec<f32>) -> Option<[f32; 2]> {
    values.retain(|value| value.is_finite());
    let last = values.len().checked_sub(1)?;
    let mut at = |share: f64| {
        let place = (share * last as f64).round() as usize;
        *values.select_nth_unstable_by(place, f32::total_cmp).1
    };
    Some([at(0.02), at(0.98)])
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
        assert!("rainbow".parse::<MapName>().unwrap_err().contains("viridis, plasma"));
    }

    /// Outliers and what is no number do not stretch the range.
    #[test]
    fn ranges_leave_outliers_out() {
        let mut values: Vec<f32> = (0..=1000u16).map(f32::from).collect();
        values.extend([1e30, f32::NAN, -1e30]);
        let [low, high] = usual_range(values).unwrap();
        assert!((15.0..25.0).contains(&low) && (975.0..985.0).contains(&high), "{low} to {high}");
        assert_eq!(usual_range(vec![f32::NAN]), None);
        assert_eq!(usual_range(vec![7.0]), Some([7.0, 7.0]));
    }

    /// A missing attribute is named with those that there are.
    #[test]
    fn missing_attributes_are_told() {
        let mut particles = Particles::from_positions(vec![Vec3::ZERO; 3]);
        particles.densities = Some(vec![1000.0; 3]);
        let by = ColorBy { attribute: Attribute::Velocity, map: MapName::default(), range: None };
        let splats = Splats::default();
        let error = by.colors(&particles, 0.1, &splats, [0.0, 1.0]).unwrap_err().to_string();
        assert!(error.contains("no velocity") && error.ends_with("they have density"), "{error}");
        assert!(Attribute::Density.values(&particles).is_some());
    }
}
