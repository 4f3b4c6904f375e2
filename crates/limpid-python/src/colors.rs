//! Colours of particles: as fluids of a clear liquid, as colours of an opaque one, or as values that a map shows.

use glam::Vec3;
use limpid::liquid::Particles;
use limpid::scene::MAX_FLUIDS;
use limpid_io::color_by::{Attribute, ColorBy, ColorScale, MapName};
use limpid_io::project::Project;
use limpid_io::spread::Spread;
use numpy::{PyArray1, PyArray2, PyArrayMethods as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The arguments that colour particles, of which the Python half gives at most one of colours (n, 3) and values (n).
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Arguments<'py> {
    colors: Option<Bound<'py, PyArray2<f32>>>,
    values: Option<Bound<'py, PyArray1<f32>>>,
    colormap: Option<String>,
    range: Option<(f32, f32)>,
    /// Whether the range is that of the values, whatever the scene has.
    automatic: bool,
}

impl Arguments<'_> {
    /// Copies the arrays.
    pub(crate) fn coloring(&self) -> PyResult<Option<Coloring>> {
        if let Some(array) = &self.values {
            let values = array.try_readonly()?.as_array().iter().copied().collect();
            let map = self.colormap.as_deref().map(map_named).transpose()?;
            let range = self.range.map(|(low, high)| [low, high]);
            let automatic = self.automatic;
            return Ok(Some(Coloring::Values { values, map, range, automatic }));
        }
        let Some(array) = &self.colors else { return Ok(None) };
        let array = array.try_readonly()?;
        let rows = array.as_array();
        let colors = rows.outer_iter().map(|row| Vec3::new(row[0], row[1], row[2])).collect();
        Ok(Some(Coloring::Colors(colors)))
    }
}

pub(crate) fn map_named(name: &str) -> PyResult<MapName> {
    name.parse().map_err(|problem| PyValueError::new_err(format!("colormap: {problem}")))
}

/// The name of a colour map as limpid writes it.
#[pyfunction]
pub(crate) fn colormap(name: &str) -> PyResult<&'static str> {
    map_named(name).map(MapName::name)
}

/// Colours of particles.
pub(crate) enum Coloring {
    /// One a particle, linear RGB.
    Colors(Vec<Vec3>),
    /// Values by a map over a range: those of the scene, or viridis over the usual range, which may also replace the
    /// scene's.
    Values { values: Vec<f32>, map: Option<MapName>, range: Option<[f32; 2]>, automatic: bool },
}

/// How coloured particles are drawn.
#[derive(Default)]
pub(crate) struct Colored {
    /// Colours of the fluids of a clear liquid, behind its thickness.
    pub(crate) tints: Option<Vec<Vec3>>,
    /// Colours of an opaque one, in place of the scene's attribute.
    pub(crate) by: Option<ColorBy>,
    /// The values that are shown.
    pub(crate) scale: Option<ColorScale>,
}

impl Coloring {
    /// Whether it needs an opaque liquid.
    pub(crate) fn is_of_values(&self) -> bool {
        matches!(self, Self::Values { .. })
    }

    /// Gives the colours to particles that are drawn in a project.
    pub(crate) fn apply(self, particles: &mut Particles, project: Option<&Project>) -> Colored {
        match self {
            Self::Values { values, map, range, automatic } => {
                let own = project.and_then(|project| project.color_by.as_ref());
                let own = own.filter(|by| by.attribute.is_mapped());
                let map = map.or(own.map(|by| by.map)).unwrap_or_default();
                let given = range.or(own.filter(|_| !automatic).and_then(|by| by.range));
                let usual = || Spread::of(values.clone()).map(|spread| spread.usual);
                let range = given.or_else(usual).unwrap_or([0.0, 1.0]);
                let named = own.filter(|by| by.attribute != of_values());
                let name = named.map_or(String::new(), |by| by.attribute.name().to_owned());
                let unit = named.map_or(String::new(), |by| by.attribute.unit().to_owned());
                let scale = ColorScale { name, unit, map, range, automatic: given.is_none() };
                // The first frames of emitters have no values that could decide a range.
                let scale = Some(scale).filter(|_| !values.is_empty());
                particles.values = Some(values);
                let by = ColorBy { map, range: Some(range), ..ColorBy::new(of_values()) };
                Colored { by: Some(by), scale, tints: None }
            }
            Self::Colors(colors) if project.is_some_and(Project::is_opaque) => {
                particles.colors = Some(colors);
                Colored { by: Some(ColorBy::new(Attribute::Color)), ..Colored::default() }
            }
            Self::Colors(colors) => {
                let (fluids, tints) = fluids(&colors);
                particles.fluids = Some(fluids);
                Colored { tints: Some(tints), ..Colored::default() }
            }
        }
    }
}

/// The attribute that stands for values from an array.
pub(crate) fn of_values() -> Attribute {
    Attribute::Other("values".into())
}

/// Absorption coefficients that leave `tint` of white light behind a thickness, 1/m. Nothing is quite black.
pub(crate) fn absorption(tint: Vec3, thickness: f64) -> Vec3 {
    const DARKEST: f32 = 1e-3;
    tint.map(|c| (-c.max(DARKEST).ln()).max(0.0)) / thickness as f32
}

/// The fluids of particles with these colours: the index of each particle's, and the fluids' colours. More colours
/// than fluids are joined into boxes of similar ones, which are cut at the median of their longest side (Heckbert,
/// "Color image quantization for frame buffer display", 1982).
fn fluids(colors: &[Vec3]) -> (Vec<u8>, Vec<Vec3>) {
    let bits = |color: &Vec3| color.to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..colors.len() as u32).collect();
    let at = |&i: &u32| colors[i as usize];
    let mut boxes: Vec<&mut [u32]> = vec![&mut order];
    let extent = |members: &[u32]| {
        let ends = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (low, high) = members
            .iter()
            .map(at)
            .fold(ends, |(low, high), color| (low.min(color), high.max(color)));
        if members.is_empty() { Vec3::ZERO } else { high - low }
    };
    while boxes.len() < MAX_FLUIDS {
        let sizes = boxes.iter().map(|members| extent(members).max_element());
        let Some((widest, size)) = sizes.enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b)) else {
            break;
        };
        if size <= 0.0 {
            break;
        }
        let members = boxes.swap_remove(widest);
        let axis = extent(members).max_position();
        members.sort_unstable_by(|a, b| at(a)[axis].total_cmp(&at(b)[axis]));
        // Equal colours stay together.
        let middle = at(&members[members.len() / 2])[axis];
        let mut cut = members.partition_point(|i| at(i)[axis] < middle);
        if cut == 0 {
            cut = members.partition_point(|i| at(i)[axis] <= middle);
        }
        let (low, high) = members.split_at_mut(cut);
        boxes.extend([low, high]);
    }
    boxes.retain(|members| !members.is_empty());
    // An order that does not depend on the cuts.
    boxes.sort_by_key(|members| members.iter().map(|i| bits(&at(i))).min());
    let mut indices = vec![0; colors.len()];
    let mut found = Vec::new();
    for (index, members) in boxes.iter().enumerate() {
        let sum: glam::DVec3 = members.iter().map(|i| at(i).as_dvec3()).sum();
        let alike = members.iter().all(|i| at(i) == at(&members[0]));
        let mean = (sum / members.len() as f64).as_vec3();
        found.push(if alike { at(&members[0]) } else { mean });
        members.iter().for_each(|&i| indices[i as usize] = index as u8);
    }
    (indices, found)
}
