//! The views that together trace all of a light: from the light itself, and orthogonally onto the
//! faces that it falls on.

use glam::{DMat3, DVec2, DVec3, UVec2};
use rayon::prelude::*;

use super::Chart;
use super::paths::Tracer;
use crate::reference::surroundings::{Side, SideForm};
use crate::reference::{Liquid, wide};
use limpid::light_view::LightView;
use limpid::scene::{Light, Scene};

/// Number of rays along each side of a light's view that find the faces on which light falls.
const PROBES: u32 = 96;

/// Share of a face's light, along a side, beyond either end of its map: single rays land far away.
/// If they land so far away that the map would be coarse, the map ends at one width of the bulk of
/// the light beyond the bulk; `BULK` is the share beyond either end of the bulk.
const OUTSIDE: f64 = 0.005;
const BULK: f64 = 0.05;

/// Cosine of half the widest angle at which one view of a point light covers the liquid.
const WIDEST: f64 = 0.5;

/// Range of the size of one of several views of a point light, pixels.
const ALL_ROUND: (f64, f64) = (64.0, 2048.0);

/// The view-from-world rotation of a view along an axis that points towards the viewer.
fn axes(back: DVec3) -> DMat3 {
    let up = if back.y.abs() > 0.999 { DVec3::NEG_Z } else { DVec3::Y };
    let right = up.cross(back).normalize();
    DMat3::from_cols(right, back.cross(right), back).transpose()
}

/// The views from a light of everything in the box between two corners, with pixels of `pixel`, m,
/// there.
pub(super) fn sources(light: &Light, (min, max): (DVec3, DVec3), pixel: f64) -> Vec<LightView> {
    let corners: [DVec3; 8] = std::array::from_fn(|i| {
        let side = |bit: usize, axis: usize| if i >> bit & 1 == 0 { min[axis] } else { max[axis] };
        DVec3::new(side(0, 0), side(1, 1), side(2, 2))
    });
    let (middle, extent) = (0.5 * (min + max), min.distance(max));
    // Margin for points that rounding and interpolated normals put on the border.
    let margin = 1.02;
    match *light {
        Light::Sun { direction, .. } => {
            let view_from_world = axes(-wide(direction).normalize());
            let seen = corners.map(|corner| view_from_world * (corner - middle));
            let half = seen.iter().fold(DVec3::ZERO, |most, x| most.max(x.abs())) * margin;
            let size = (2.0 * half.truncate() / pixel).ceil().max(DVec2::ONE);
            vec![LightView {
                origin: middle
                    + view_from_world.transpose() * DVec3::new(0.0, 0.0, half.z + extent),
                view_from_world,
                half_extent: half.truncate().max(DVec2::splat(f64::MIN_POSITIVE)),
                near: 0.0,
                far: 2.0 * (half.z + extent),
                orthographic: true,
                size: size.as_uvec2(),
                level: None,
            }]
        }
        Light::Point { position, .. } => {
            let origin = wide(position);
            let view = |back: DVec3, half: DVec2, size: DVec2| LightView {
                origin,
                view_from_world: axes(back),
                half_extent: half,
                near: 0.0,
                far: f64::INFINITY,
                orthographic: false,
                size: size.ceil().as_uvec2().max(UVec2::ONE),
                level: None,
            };
            let distance = origin.distance(middle).max(0.5 * extent);
            if let Some(back) = (origin - middle).try_normalize() {
                let seen = corners.map(|corner| axes(back) * (corner - origin));
                if seen.iter().all(|x| -x.z > WIDEST * x.length()) {
                    let half = seen.map(|x| (x.truncate() / x.z).abs());
                    let half = half.into_iter().fold(DVec2::ZERO, DVec2::max) * margin;
                    return vec![view(back, half, 2.0 * half * distance / pixel)];
                }
            }
            let side = (2.0 * distance / pixel).clamp(ALL_ROUND.0, ALL_ROUND.1);
            let all = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
            all.map(|axis| view(axis, DVec2::ONE, DVec2::splat(side))).collect()
        }
    }
}

/// The faces of lit solids on which light falls, with pixels of `pixel`, m, but at most `most`
/// along a side.
pub(super) fn of_solids(
    liquid: &(impl Liquid + ?Sized),
    scene: &Scene,
    sources: &[LightView],
    interfaces: u32,
    pixel: f64,
    most: u32,
) -> Vec<Chart> {
    let mut faces: Vec<(Side, Vec<DVec3>)> = Vec::new();
    for source in sources {
        let tracer = Tracer::new(liquid, scene, source, &[], interfaces);
        let spots: Vec<_> = (0..PROBES * PROBES)
            .into_par_iter()
            .filter_map(|i| {
                let at = UVec2::new(i % PROBES, i / PROBES).as_dvec2() + 0.5;
                let beam = tracer.follow(at / f64::from(PROBES) * source.size.as_dvec2());
                beam.landing().map(|landing| landing.spot)
            })
            .collect();
        for spot in spots.into_iter().filter(|spot| scene.solids[spot.solid].lit) {
            match faces.iter_mut().find(|(face, _)| face.takes(spot.solid, spot.part, spot.normal))
            {
                Some((_, points)) => points.push(spot.point),
                None => {
                    let face = tracer.surroundings.side(spot.solid, spot.part, spot.normal);
                    faces.push((face, vec![spot.point]));
                }
            }
        }
    }
    faces.into_iter().map(|(face, points)| chart(face, &points, pixel, most)).collect()
}

/// The orthogonal view onto a face that contains these points of it.
fn chart(face: Side, points: &[DVec3], pixel: f64, most: u32) -> Chart {
    let view_from_world = axes(face.axis);
    let seen: Vec<_> = points.iter().map(|&x| view_from_world * x).collect();
    let range = |axis: usize| {
        let mut along: Vec<_> = seen.iter().map(|x| x[axis]).collect();
        along.sort_by(f64::total_cmp);
        let last = (along.len() - 1) as f64;
        let at = |share: f64| along[(share * last).round() as usize];
        let (low, high) = (at(BULK), at(1.0 - BULK));
        let room = high - low;
        (at(OUTSIDE).max(low - room), at(1.0 - OUTSIDE).min(high + room))
    };
    let ((left, right), (low, high)) = (range(0), range(1));
    let (low, high) = (DVec2::new(left, low), DVec2::new(right, high));
    // Margin for rays that land beyond the probes.
    let half = 0.5 * (1.0 + 4.0 / f64::from(PROBES)) * (high - low) + 4.0 * pixel;
    let pixel = pixel.max(2.0 * half.max_element() / f64::from(most));
    let size = (2.0 * half / pixel).ceil();
    // Slightly above the face, or above the top of a sphere or of a part of a mesh.
    let scale = points.iter().fold(1.0, |most: f64, x| most.max(x.abs().max_element()));
    let top = match face.form {
        SideForm::Flat => seen[0].z,
        SideForm::Round { center, radius } => (view_from_world * center).z + radius,
        SideForm::Uneven { top } => top,
    };
    let above = top + 1e-6 * scale;
    let view = LightView {
        origin: view_from_world.transpose() * (0.5 * (low + high)).extend(above),
        view_from_world,
        half_extent: 0.5 * pixel * size,
        near: 0.0,
        far: 1.0,
        orthographic: true,
        size: size.as_uvec2(),
        level: None,
    };
    Chart { view, face: Some(face) }
}
