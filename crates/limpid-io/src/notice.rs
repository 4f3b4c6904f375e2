//! What is worth knowing of a run besides its pictures: nothing is wrong for certain, but it may be
//! why a picture is not what was meant. Whoever draws decides whether to say it.

use std::fmt;

use glam::{DVec3, Mat3, UVec2, Vec3};
use rayon::prelude::*;

use crate::input::{Input, Loaded, Missing, RadiusFrom};
use limpid::camera::Camera;
use limpid::liquid::Particles;
use limpid::liquid::classify::{self, Splat};
use limpid::scene::Scene;

/// One such remark. Its text is one line, without a remedy in terms of any program's options.
#[derive(Debug, Clone, PartialEq)]
pub enum Notice {
    /// Numbers between the frames of a sequence that no file has, as ranges, and what stands for them
    /// in pictures.
    Gaps(Vec<(i64, i64)>, Option<Missing>),
    /// Nothing says how many frames a second a sequence has; so many are taken for it.
    Rate(f64),
    /// Lights shine on nothing that shows it.
    Unlit,
    /// The particles are the corners of a mesh of so many cells.
    Mesh(usize),
    /// So many particles are far from all others.
    Lost(usize),
    /// An array that is ignored may be what the radius was guessed for.
    MaybeRadius(String),
    /// The particles are much closer together than their radius, m.
    Crowded(f32),
    /// Hardly any light comes through so many metres of this liquid: perhaps they are millimetres.
    Opaque {
        /// The longest side of the box around the bulk of the particles, m.
        extent: f64,
        /// Absorption coefficient, 1/m.
        absorption: Vec3,
    },
    /// No liquid is in a picture of so many particles.
    Unseen(usize),
    /// So many of the particles of a picture are beside it or behind the camera.
    Outside(usize, usize),
    /// Lights, by their numbers from 0, have no caustics: [`limpid::renderer::Renderer::lights_without_caustics`].
    Straight(Vec<usize>),
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gaps(gaps, missing) => {
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
                write!(f, "frames are missing{done}: {}{more}", some.join(", "))
            }
            Self::Rate(fps) => write!(
                f,
                "the sequence's frames per second are not known, {fps} assumed"
            ),
            Self::Unlit => f.write_str(
                "[[light]] lights nothing: no [[solid]] has `lit = true`, and liquid shows no light \
                 by itself",
            ),
            Self::Mesh(cells) => write!(
                f,
                "the file is a mesh (cells: {cells}), and its corners are drawn as particles; export \
                 the particles that it was made from"
            ),
            Self::Lost(count) => {
                let (are, do_not) = if *count == 1 { ("is", "does") } else { ("are", "do") };
                write!(
                    f,
                    "{} of the particles {are} far from all others and {do_not} not count for the \
                     view, the floor and the lights",
                    thousands(*count)
                )
            }
            Self::MaybeRadius(array) => {
                write!(f, "{array} is ignored, and the radius is guessed")
            }
            Self::Crowded(radius) => write!(
                f,
                "the particles are much closer together than their radius of {radius} m, which makes one \
                 blob of them and takes long: their places and their radius may be in different units"
            ),
            Self::Opaque { extent, .. } => {
                write!(f, "the particles extend over {extent:.0} m, through which no light comes")
            }
            Self::Unseen(particles) => write!(
                f,
                "no liquid is visible: all {} particles are out of the picture",
                thousands(*particles)
            ),
            Self::Outside(outside, particles) => write!(
                f,
                "{:.0} % of the particles are out of the picture",
                (100.0 * *outside as f64 / *particles as f64).floor()
            ),
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

/// A number with commas between its thousands: `40,368`.
pub fn thousands(number: usize) -> String {
    let digits = number.to_string();
    let comma = |at: usize| at > 0 && (digits.len() - at).is_multiple_of(3);
    let digit = |(at, digit)| if comma(at) { vec![',', digit] } else { vec![digit] };
    digits.chars().enumerate().flat_map(digit).collect()
}

/// Of a sequence, all of whose frames are drawn.
pub fn of_sequence(input: &Input) -> Option<Notice> {
    let gaps = input.sequence.gaps();
    (!gaps.is_empty()).then_some(Notice::Gaps(gaps, Some(input.missing)))
}

/// Of a scene, whatever particles are drawn in it.
pub fn of_scene(scene: &Scene) -> Option<Notice> {
    (!scene.lights.is_empty() && !scene.is_lit()).then_some(Notice::Unlit)
}

/// Of a frame of particles, wherever it is seen from.
pub fn of_frame(loaded: &Loaded, scene: &Scene) -> Vec<Notice> {
    let mut notices = Vec::new();
    if loaded.cells > 0 {
        notices.push(Notice::Mesh(loaded.cells));
    }
    if loaded.bulk.outside > 0 {
        notices.push(Notice::Lost(loaded.bulk.outside));
    }
    if loaded.radius_from == RadiusFrom::Guess {
        const RADII: [&str; 7] = ["r", "h", "diameter", "diam", "size", "psize", "rad"];
        let named = |name: &str| RADII.iter().any(|radius| name.eq_ignore_ascii_case(radius));
        let mut ignored = loaded.arrays.iter().filter(|array| array.used_as.is_none());
        let radius = ignored.find(|array| named(&array.name));
        notices.extend(radius.map(|array| Notice::MaybeRadius(array.name.clone())));
    }
    notices.extend(crowded(loaded));
    notices.extend(opaque(loaded.bulk.bounds, scene));
    notices
}

fn crowded(loaded: &Loaded) -> Option<Notice> {
    /// No method has a radius so many times that by the spacing: three at most, and centres that are
    /// smoothed over such a crowd are up to twice as close.
    const TOO_LARGE: f32 = 8.0;
    /// More particles take too long to look at for a word.
    const MOST: usize = 2_000_000;
    let splats = &loaded.splats;
    let all = || splats.aggregates.iter().chain(&splats.splashes).filter(|splat| !splat.is_copy());
    if loaded.radius_from == RadiusFrom::Guess || all().count() > MOST {
        return None;
    }
    // Not worth an end for want of memory.
    classify::probe_memory(splats.aggregates.len() + splats.splashes.len(), "a notice").ok()?;
    let places = all().map(|splat| Vec3::from_array(splat.centre)).collect();
    let spaced = classify::estimate_radius(&Particles::from_positions(places));
    let crowded = spaced > 0.0 && splats.radius > TOO_LARGE * spaced;
    crowded.then_some(Notice::Crowded(splats.radius))
}

fn opaque((min, max): (DVec3, DVec3), scene: &Scene) -> Option<Notice> {
    /// Metres, beyond which a simulation is unusual.
    const LARGE: f64 = 100.0;
    /// Of the light of the least absorbed colour, e⁻¹⁰ is left.
    const DEPTH: f64 = 10.0;
    let extent = (max - min).max_element();
    let mut absorptions = scene.absorptions().into_iter();
    let dark = |absorption: &Vec3| f64::from(absorption.min_element()) * extent > DEPTH;
    let absorption = absorptions.find(dark).filter(|_| extent > LARGE)?;
    Some(Notice::Opaque { extent, absorption })
}

/// Of a picture of `size` pixels: whether the particles are in it. What solids hide counts as seen.
pub fn of_view(loaded: &Loaded, camera: &Camera, size: UVec2) -> Option<Notice> {
    let splats = &loaded.splats;
    let view = camera.uniform(size, splats.origin);
    let turn = Mat3::from_cols_array_2d(&view.view_from_world.map(|[x, y, z, _]| [x, y, z]));
    // How far a sphere of radius 1 reaches over the planes through the picture's edges.
    let slant = (view.tangent * view.tangent + 1.0).map(f32::sqrt);
    let seen = |splat: &Splat| {
        let x = turn * (Vec3::from_array(splat.centre) + view.origin);
        let reach = splat.longest() as f32;
        let depth = -x.z;
        depth + reach > view.near
            && (x.x.abs() <= depth * view.tangent.x + reach * slant.x)
            && (x.y.abs() <= depth * view.tangent.y + reach * slant.y)
    };
    let count = splats.aggregates.len() + splats.splashes.len();
    let all = splats.aggregates.par_iter().chain(&splats.splashes).with_min_len(4096);
    let outside = count - all.filter(|splat| seen(splat)).count();
    if count == 0 {
        None
    } else if outside == count {
        Some(Notice::Unseen(loaded.particles))
    } else {
        (2 * outside > count).then_some(Notice::Outside(outside, count))
    }
}
