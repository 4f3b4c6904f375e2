//! Notices: conditions that are no errors, but likely reasons for an unexpected picture. The program
//! decides whether to show them.

use std::f64::consts::PI;
use std::fmt;

use glam::{DVec3, Mat3, UVec2, Vec2, Vec3};
use rayon::prelude::*;

use crate::color_by::ColorScale;
use crate::frames::FrameSpec;
use crate::input::{Loaded, Loader, Missing, RadiusFrom};
use crate::particles::Remark;
use crate::sequence::Sequence;
use limpid::camera::{Camera, View};
use limpid::diffuse::DiffuseKind;
use limpid::liquid::classify::{self, Splat};
use limpid::liquid::{Particles, Up};
use limpid::scene::Scene;

pub use crate::number::{brief, thousands};

/// The numbers of foam, spray, bubbles and dust, by kind: `1,204 foam, 33 bubbles`. `None` if there are none.
pub fn diffuse_counts(counts: [usize; DiffuseKind::ALL.len()]) -> Option<String> {
    let kinds = DiffuseKind::ALL.into_iter().zip(counts).filter(|(_, count)| *count > 0);
    let each: Vec<_> =
        kinds.map(|(kind, count)| format!("{} {}", thousands(count), kind.name())).collect();
    (!each.is_empty()).then(|| each.join(", "))
}

/// A notice. Its text is one line, without a remedy in terms of a program's options.
#[derive(Debug, Clone, PartialEq)]
pub enum Notice {
    /// Ranges of missing numbers within a sequence, and the treatment of missing frames.
    Gaps(Vec<(i64, i64)>, Option<Missing>),
    /// Number of frames that were selected by ranges of numbers, in a sequence that is numbered by steps of this
    /// length, or of varying length.
    Steps(usize, Option<u64>),
    /// The frame rate of the sequence is unknown and assumed to be this, frames per second.
    Rate(f64),
    /// A remark on a particle file.
    Read(Remark),
    /// A mesh's file contains or names something that is not shown: a sentence.
    Incomplete(String),
    /// The scene has lights, but no lit solid.
    Unlit,
    /// The particles are the vertices of a mesh with this number of cells.
    Mesh(usize),
    /// Particles far from all others.
    Lost {
        /// Their number.
        count: usize,
        /// The box that they are in, in the axes of the files, m.
        place: (DVec3, DVec3),
    },
    /// An ignored array that may contain the radius, which was guessed.
    MaybeRadius(String),
    /// The particles are much closer together than their radius, m.
    Crowded(f32),
    /// The particles are much farther apart than their given radius, m.
    Scattered(f32),
    /// As [`Self::Scattered`], where the drops are too small for any pixel, as [`Self::Dots`] are.
    Vanishing(f32),
    /// The liquid is so large that it is nearly opaque: its unit may be millimetres. The longest side of
    /// the box around the bulk of the particles, m.
    Opaque(f64),
    /// All particles in the picture together take less than a pixel: the width of one, pixels.
    Dots(f64),
    /// No pixel of a picture whose coverage varies is covered.
    Uncovered,
    /// None of the particles is in the picture.
    Unseen {
        /// Their number.
        particles: usize,
        /// The box of their bulk, in the axes in which the camera was given, m.
        bulk: (DVec3, DVec3),
        /// The axis that points up there.
        up: Up,
    },
    /// Number of particles outside the picture or behind the camera, and number of all particles.
    Outside(usize, usize),
    /// Colours show values over a range that the particles decide.
    Colors(ColorScale),
    /// Pictures of this size are too small for a legend.
    NoLegend(UVec2),
    /// Lights without caustics, by their numbers from 0:
    /// [`limpid::renderer::Renderer::lights_without_caustics`].
    Straight(Vec<usize>),
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gaps(gaps, missing) => f.write_str(&gaps_text(gaps, *missing)),
            Self::Steps(frames, stride) => {
                let frames = if *frames == 1 { "1 frame".into() } else { format!("{frames} frames") };
                match stride {
                    Some(stride) => write!(f, "{frames}: the files are numbered by steps of {stride}"),
                    None => write!(f, "{frames}: the files are numbered by steps of varying length"),
                }
            }
            Self::Rate(fps) => write!(
                f,
                "the sequence's frames per second are not known, {fps} assumed"
            ),
            Self::Read(remark) => remark.fmt(f),
            Self::Incomplete(remark) => f.write_str(remark),
            Self::Unlit => f.write_str(
                "[[light]] has no effect: no [[solid]] has `lit = true`, and only lit solids show the \
                 light",
            ),
            Self::Mesh(cells) => write!(
                f,
                "the file is a mesh (cells: {cells}), and its corners are drawn as particles; export \
                 the particles that it was made from"
            ),
            Self::Lost { count, place } => f.write_str(&lost_text(*count, *place)),
            Self::MaybeRadius(array) => {
                write!(f, "the radius is guessed, although there is {array}")
            }
            Self::Crowded(radius) => write!(
                f,
                "the particles are much closer together than their radius of {radius} m, which makes one \
                 blob of them and takes long"
            ),
            Self::Scattered(radius) => write!(
                f,
                "the particles are much farther apart than their radius of {radius} m, and each is drawn as a \
                 drop of its own"
            ),
            Self::Vanishing(radius) => write!(
                f,
                "no liquid is visible: the particles are much farther apart than their radius of {radius} m"
            ),
            Self::Opaque(extent) => {
                write!(f, "the particles extend over {extent:.0} m; at this size the liquid is opaque")
            }
            Self::Dots(width) => write!(
                f,
                "no liquid is visible: the particles are {width:.1e} pixels wide"
            ),
            Self::Uncovered => f.write_str("no liquid is visible: the picture is empty"),
            Self::Unseen { particles, bulk: (min, max), up } => {
                let size = *max - *min;
                let unit = 0.01 * size.max_element();
                write!(
                    f,
                    "no liquid is visible: all {} particles are out of the picture; they are around {} m, \
                     {} m large, where {up} is up",
                    thousands(*particles),
                    rounded(0.5 * (*min + *max), unit),
                    rounded(size, unit).replace(',', " x ")
                )
            }
            Self::Outside(outside, particles) => write!(
                f,
                "{:.0} % of the particles are out of the picture",
                (100.0 * *outside as f64 / *particles as f64).floor()
            ),
            Self::Colors(ColorScale { name, unit, range, .. }) => {
                let [low, high] = range.map(brief);
                let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
                write!(
                    f,
                    "colors show {name} from {low} to {high}{unit} in every frame: the 2nd to 98th percentile of the \
                     sequence"
                )
            }
            Self::NoLegend(UVec2 { x, y }) => {
                write!(f, "no legend is drawn: pictures of {x} x {y} are too small for it")
            }
            Self::Straight(lights) => {
                let numbers: Vec<String> = lights.iter().map(|light| (light + 1).to_string()).collect();
                write!(
                    f,
                    "no caustics by [[light]] {}: a point light in the liquid, or so near that it sees \
                     it under more than 150 degrees, shines straight through; move it away from the \
                     liquid",
                    numbers.join(", ")
                )
            }
        }
    }
}

/// [`Notice::Gaps`] in words.
fn gaps_text(gaps: &[(i64, i64)], missing: Option<Missing>) -> String {
    let range = |&(first, last): &(i64, i64)| match first == last {
        true => first.to_string(),
        false => format!("{first} to {last}"),
    };
    let some: Vec<String> = gaps.iter().take(5).map(range).collect();
    let more = if gaps.len() > 5 { ", ..." } else { "" };
    let done = match missing {
        None => "",
        Some(Missing::Error) => " and left out",
        Some(Missing::Empty) => " and drawn without particles",
        Some(Missing::Hold) => " and drawn as the frame before",
    };
    format!("frames are missing{done}: {}{more}", some.join(", "))
}

/// [`Notice::Lost`] in words.
fn lost_text(count: usize, (min, max): (DVec3, DVec3)) -> String {
    let (are, do_not) = if count == 1 { ("is", "does") } else { ("are", "do") };
    let size = (max - min).max_element();
    let digits = if size > 0.0 { size } else { max.abs().max_element() };
    let corner = |x: DVec3| rounded(x, 1e-3 * digits);
    let place = match size > 0.0 {
        false => format!("at {}", corner(max)),
        true => format!("from {} to {}", corner(min), corner(max)),
    };
    format!(
        "{} of the particles {are} far from all others, {place} m, and {do_not} not count for the view, the floor and \
         the lights",
        thousands(count)
    )
}

/// Formats a place to about this precision, m: `0.25,1,-3.5`.
fn rounded(x: DVec3, precision: f64) -> String {
    let decimals = (-precision.log10()).ceil().clamp(0.0, 12.0) as usize;
    let number = |x: f64| {
        // Without the sign of a 0, and in decimals that say something.
        let x = format!("{x:.decimals$}").parse().unwrap_or(x) + 0.0;
        format!("{x}")
    };
    x.to_array().map(number).join(",")
}

/// The notice about a sequence of which all frames are drawn.
pub fn of_sequence(loader: &Loader) -> Option<Notice> {
    let gaps = loader.sequence.gaps();
    (!gaps.is_empty()).then_some(Notice::Gaps(gaps, Some(loader.missing)))
}

/// The notice about `count` frames that were selected in a sequence by their numbers.
pub fn of_selection(spec: &FrameSpec, sequence: &Sequence, count: usize) -> Option<Notice> {
    spec.counts_steps(sequence).then(|| Notice::Steps(count, sequence.even_stride()))
}

/// The notice about a scene, independent of its particles.
pub fn of_scene(scene: &Scene) -> Option<Notice> {
    (!scene.lights.is_empty() && !scene.is_lit()).then_some(Notice::Unlit)
}

/// Notices about a frame of particles, independent of the camera.
pub fn of_frame(loaded: &Loaded, scene: &Scene) -> Vec<Notice> {
    let mut notices = of_reading(loaded);
    if loaded.cells > 0 {
        notices.push(Notice::Mesh(loaded.cells));
    }
    if let Some(place) = loaded.bulk.lost {
        let place = turned(place, loaded.up.0);
        notices.push(Notice::Lost { count: loaded.bulk.outside, place });
    }
    if loaded.radius_from == RadiusFrom::Guess {
        const RADII: [&str; 6] = ["r", "h", "d", "size", "psize", "rad"];
        let named = |name: &str| {
            RADII.iter().any(|radius| name.eq_ignore_ascii_case(radius))
                || name.to_ascii_lowercase().contains("diam")
        };
        let mut ignored = loaded.arrays.iter().filter(|array| array.used_as.is_none());
        let radius = ignored.find(|array| named(&array.name));
        notices.extend(radius.map(|array| Notice::MaybeRadius(array.name.clone())));
    }
    notices.extend(misfit(loaded).or_else(|| opaque(loaded.bulk.bounds, scene)));
    notices
}

/// Notices about the files of a frame.
pub fn of_reading(loaded: &Loaded) -> Vec<Notice> {
    let mut remarks: Vec<&Remark> = Vec::new();
    for remark in &loaded.remarks {
        if !remarks.iter().any(|told| told.subject() == remark.subject()) {
            remarks.push(remark);
        }
    }
    remarks.into_iter().cloned().map(Notice::Read).collect()
}

/// Whether the radius is far too large for the spacing of the particles, or too small.
fn misfit(loaded: &Loaded) -> Option<Notice> {
    /// Ratio of the radius to the estimate from the spacing that no simulation method has: at most
    /// three, and smoothing of the centres halves the spacing of such particles at most.
    const TOO_LARGE: f32 = 8.0;
    /// Ratio below which not even spray has radii: metres beside centimetres or millimetres.
    const TOO_SMALL: f32 = 0.03;
    /// Largest number of particles to check, which takes long.
    const MAX_CHECKED: usize = 2_000_000;
    let splats = &loaded.splats;
    let is_particle =
        |splat: &&Splat| !splat.is_copy() && !splat.is_interior() && is_of_the_bulk(splat, loaded);
    let all = || splats.aggregates.iter().chain(&splats.splashes).filter(is_particle);
    if loaded.radius_from == RadiusFrom::Guess || loaded.particles > MAX_CHECKED {
        return None;
    }
    // A lack of memory skips the notice.
    classify::probe_memory(splats.aggregates.len() + splats.splashes.len(), "a notice").ok()?;
    let positions = all().map(|splat| Vec3::from_array(splat.centre)).collect();
    let estimate = classify::estimate_radius(&Particles::from_positions(positions));
    if estimate > 0.0 && splats.radius > TOO_LARGE * estimate {
        Some(Notice::Crowded(splats.radius))
    } else if splats.radius < TOO_SMALL * estimate {
        Some(Notice::Scattered(splats.radius))
    } else {
        None
    }
}

/// Whether a splat is in the bulk of its frame.
fn is_of_the_bulk(splat: &Splat, loaded: &Loaded) -> bool {
    let place = || loaded.splats.origin + Vec3::from_array(splat.centre).as_dvec3();
    loaded.bulk.outside == 0 || loaded.bulk.holds(place())
}

/// A box of the world in axes where this one points up.
fn turned((min, max): (DVec3, DVec3), up: Up) -> (DVec3, DVec3) {
    let (a, b) = (up.from_y_up(min), up.from_y_up(max));
    (a.min(b), a.max(b))
}

/// Whether the liquid within these bounds is unusually large and nearly opaque.
fn opaque((min, max): (DVec3, DVec3), scene: &Scene) -> Option<Notice> {
    /// Extent beyond which a simulation is unusual, m.
    const LARGE: f64 = 100.0;
    /// Optical depth of the least absorbed colour, of which e⁻¹⁰ is transmitted.
    const DEPTH: f64 = 10.0;
    let extent = (max - min).max_element();
    let dark = |absorption: &Vec3| f64::from(absorption.min_element()) * extent > DEPTH;
    (extent > LARGE && scene.absorptions().iter().any(dark)).then_some(Notice::Opaque(extent))
}

/// The notice about a picture of `size` pixels: whether the particles are in it, those of the bulk. Particles hidden by
/// solids count as visible. `up` is the axis that points up where the camera was given.
pub fn of_view(loaded: &Loaded, camera: &Camera, size: UVec2, up: Up) -> Option<Notice> {
    let splats = &loaded.splats;
    let is_parallel = View::from(camera).is_orthographic();
    let view = camera.uniform(size, splats.origin);
    let turn = Mat3::from_cols_array_2d(&view.view_from_world.map(|[x, y, z, _]| [x, y, z]));
    // Reach of a unit sphere beyond the planes through the picture's edges, measured along x and y.
    let widest = view.tangent + view.shift.abs();
    let slant = (widest * widest + 1.0).map(f32::sqrt);
    let visible = |splat: &Splat| {
        let x = turn * (Vec3::from_array(splat.centre) + view.origin);
        let reach = splat.longest() as f32;
        let depth = -x.z;
        // Of the picture's half, its middle, and the splat beyond its edge.
        let (half, middle, edge) = match is_parallel {
            true => (view.tangent, view.shift, Vec2::splat(reach)),
            false => (depth * view.tangent, depth * view.shift, reach * slant),
        };
        depth + reach > view.near && (x.truncate() - middle).abs().cmple(half + edge).all()
    };
    let counts = |splat: &&Splat| is_of_the_bulk(splat, loaded);
    let all =
        || splats.aggregates.par_iter().chain(&splats.splashes).with_min_len(4096).filter(counts);
    let interior = all().filter(|splat| splat.is_interior()).count();
    let single = all().count() - interior;
    // Particles that a splat of the interior stands for, on average.
    let of_bulk = loaded.particles.saturating_sub(loaded.bulk.outside);
    let share = of_bulk.saturating_sub(single) as f64 / interior.max(1) as f64;
    let particles = |splat: &Splat| if splat.is_interior() { share } else { 1.0 };
    let count = single + (share * interior as f64).round() as usize;
    let seen: f64 = all().filter(|splat| visible(splat)).map(particles).sum();
    let outside = count - (seen.round() as usize).min(count);
    if count == 0 {
        None
    } else if outside == count {
        let bulk = turned(loaded.bulk.bounds, up);
        Some(Notice::Unseen { particles: loaded.particles, bulk, up })
    } else if let Some(width) =
        width_of_dots(all().filter(|splat| visible(splat)), camera, size, splats.origin)
    {
        Some(Notice::Dots(width))
    } else {
        (2 * outside > count).then_some(Notice::Outside(outside, count))
    }
}

/// Width of the widest of the visible splats, pixels, if all of them together cover less than half a pixel.
fn width_of_dots<'a>(
    visible: impl ParallelIterator<Item = &'a Splat>,
    camera: &Camera,
    size: UVec2,
    origin: DVec3,
) -> Option<f64> {
    const LEAST: f64 = 0.5;
    let view = View::from(camera);
    let uniform = view.uniform(size, origin, 0.0);
    let (from_eye, ahead) = (origin - view.eye, view.ahead());
    // Pixels per unit of the picture's plane: tangents, or metres.
    let pixels = 0.5 * f64::from(size.y) / f64::from(uniform.tangent.y);
    let radius = |splat: &Splat| {
        let depth = (from_eye + Vec3::from_array(splat.centre).as_dvec3()).dot(ahead);
        let depth = if view.is_orthographic() { 1.0 } else { depth.max(f64::from(uniform.near)) };
        pixels * splat.longest() / depth
    };
    // Of many that hide each other, the sum is too large, and says nothing.
    let (area, widest) = visible
        .map(radius)
        .map(|radius| (PI * radius * radius, radius))
        .reduce(|| (0.0, 0.0), |(area, widest), (more, radius)| (area + more, widest.max(radius)));
    (area < LEAST).then_some(2.0 * widest)
}
