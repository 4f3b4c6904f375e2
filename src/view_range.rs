//! Where the liquid lies along a view: the range that 32-bit floats can draw, near and far planes, and whether the
//! eye is inside.

use glam::{DVec2, DVec3, UVec2, Vec3, Vec3Swizzles as _};
use rayon::prelude::*;

use crate::camera::{CameraUniform, Lens, Projection, View};
use crate::error::{Error, Result};
use crate::liquid::blocks::{Block, Blocks};
use crate::liquid::classify::{self, DeviceSplats, Splat, Splats};
use crate::scene::{Scene, Shape, Solid, Surface};

/// Fails if the product of a splat's axes and its distance, squared, leaves the range of 32-bit
/// floats: the liquid would be invisible.
pub(crate) fn check_scale(splats: &Splats, view: &View) -> Result<()> {
    /// Range of radius times distance, m²; pictures are correct up to both ends.
    const PRODUCTS: std::ops::RangeInclusive<f64> = 1e-18..=1e18;
    let (radius, distance) = (f64::from(splats.radius), view.focus);
    if splats.is_empty() || PRODUCTS.contains(&(radius * distance)) {
        return Ok(());
    }
    let problem = format!(
        "a particle radius of {radius:e} m seen from {distance:e} m cannot be drawn: their product must be \
         1e-18 to 1e18 m²; choose another unit of length"
    );
    Err(Error::invalid("particles", problem))
}

/// Distances, in radii or in sides of a pixel if these are longer: up to the first, 32-bit depths resolve particles well, and
/// beyond the second they make noise of them.
const RESOLVED: std::ops::Range<f64> = 1e5..1e6;

/// A view from farther away than 32-bit depths resolve particles, from near by: with parallel rays, which move
/// nothing in the picture by more than a tenth of a pixel. Any other view is returned as it is.
///
/// # Errors
/// [`Error::Invalid`] if rays are not parallel enough for the picture's contents, with the distance from which they are.
pub(crate) fn from_near_by(
    view: View,
    scene: &Scene,
    splats: &Splats,
    size: UVec2,
) -> Result<View> {
    /// Largest displacement by parallel rays, pixels.
    const DISPLACED: f64 = 0.1;
    /// Distances, in lengths of its fade, to which a ground's pattern shows, and at which the ground is no more than the
    /// environment at the horizon.
    const PATTERN: f64 = 1.5;
    const FADED: f64 = 4.0;
    let (from_eye, ahead) = (splats.origin - view.eye, view.ahead());
    let ends = |splat: Splat| {
        let depth = (from_eye + Vec3::from_array(splat.centre).as_dvec3()).dot(ahead);
        (depth - splat.longest(), depth + splat.longest())
    };
    let (radius, pixels) = (f64::from(splats.radius), size.as_dvec2());
    let length = |depth: f64| radius.max(view.pixel_side(size, depth));
    let all = || splats.outline().map(ends);
    let is_resolved = |(nearest, _)| nearest <= 0.0 || nearest <= RESOLVED.start * length(nearest);
    // In a usual view the first one is.
    if all().next().is_none() || all().any(is_resolved) {
        return Ok(view);
    }
    let wider = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
    let liquid = all().fold((f64::INFINITY, f64::NEG_INFINITY), wider);
    let middle = 0.5 * (liquid.0 + liquid.1);
    let (half, shift) = view.borders(size);
    let tolerance = DISPLACED * view.pixel_side(size, middle);
    let (mut shown, mut first, mut begins_behind) = (liquid, liquid.0, false);
    for solid in &scene.solids {
        let Some(depths) = depths_of(solid, &view, (half, shift)) else { continue };
        let pattern = within_fade(solid, &view, depths, FADED);
        first = first.min(pattern.0);
        // Rays from near by would see what lies beneath a ground that they have met long before.
        begins_behind |=
            depths.0 < pattern.0 && !hides_nothing(solid, &view, scene, splats, tolerance);
        shown = wider(shown, within_fade(solid, &view, depths, PATTERN));
    }
    let displaced = 0.5 * (pixels * (half + shift.abs()) / half).max_element();
    let apart = (middle - shown.0).max(shown.1 - middle);
    let apart = if begins_behind { f64::INFINITY } else { apart };
    let parallel = view.is_orthographic() && !begins_behind;
    if !parallel && displaced * apart > DISPLACED * middle {
        let most = RESOLVED.end * length(middle);
        if middle <= most {
            return Ok(view);
        }
        let least = displaced * apart / DISPLACED;
        let remedy = match least.is_finite() {
            true => format!("or farther than {least:.1e} m"),
            false => "or draw without the ground that hides what is beneath it".to_owned(),
        };
        let problem = format!(
            "particles of a radius of {} m are {middle:.1e} m away, where 32-bit floats do not tell their front \
             from their back; move it nearer than {most:.1e} m, {remedy}",
            splats.radius
        );
        return Err(Error::invalid("camera", problem));
    }
    let margin = (1e-3 * (liquid.1 - first)).max(16.0 * radius);
    let moved = first - margin;
    let projection = match view.projection {
        Projection::Orthographic { .. } | Projection::Lens(Lens::Orthographic { .. }) => {
            view.projection
        }
        _ => {
            Projection::Orthographic { low: middle * (shift - half), high: middle * (shift + half) }
        }
    };
    Ok(View {
        eye: view.eye + moved * ahead,
        projection,
        focus: middle - moved,
        near: view.near.map(|near| (f64::from(near) - moved).max(0.0) as f32),
        ..view
    })
}

/// Depths between which a solid is in the picture, m; `None` for one that is not. `borders` are half the picture's extent
/// and its middle.
fn depths_of(solid: &Solid, view: &View, (half, shift): (DVec2, DVec2)) -> Option<(f64, f64)> {
    let parallel = view.is_orthographic();
    let ends = |depths: &mut dyn Iterator<Item = f64>| {
        depths.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), z| (a.min(z), b.max(z)))
    };
    if let Some(corners) = solid.shape.corners() {
        let seen = corners.map(|x| view.view_from_world * (x - view.eye));
        let beside = |axis: usize, sign: f64| {
            seen.iter().all(|x| {
                let per_metre = if parallel { 1.0 } else { (-x.z).max(0.0) };
                sign * (x[axis] - per_metre * shift[axis]) > per_metre * half[axis]
            })
        };
        let (near, far) = ends(&mut seen.iter().map(|x| -x.z));
        let outside = (0..2).any(|axis| beside(axis, 1.0) || beside(axis, -1.0));
        return (far > 0.0 && !outside).then_some((near.max(0.0), far));
    }
    let Shape::Plane { origin, normal, .. } = solid.shape else { return None };
    let from_eye = view.view_from_world * (origin - view.eye);
    let normal = view.view_from_world * normal.as_dvec3();
    let meets = [DVec2::new(-1.0, -1.0), DVec2::new(1.0, -1.0), DVec2::new(-1.0, 1.0), DVec2::ONE]
        .map(|corner| {
            let at = shift + corner * half;
            let (start, step) = match parallel {
                true => (at.extend(0.0), DVec3::NEG_Z),
                false => (DVec3::ZERO, at.extend(-1.0)),
            };
            let depth = (from_eye - start).dot(normal) / step.dot(normal);
            // Rays that lead away from it meet it nowhere, and those beside them far away.
            if depth > 0.0 { depth } else { f64::INFINITY }
        });
    let (near, far) = ends(&mut meets.into_iter());
    near.is_finite().then_some((near, far))
}

/// Depths of a ground that fades, no farther from its origin than this many times the fade's length; those of others are
/// returned as they are.
fn within_fade(solid: &Solid, view: &View, (near, far): (f64, f64), fades: f64) -> (f64, f64) {
    let (Shape::Plane { origin, .. }, Surface::Ground { fade, .. }) =
        (&solid.shape, &solid.surface)
    else {
        return (near, far);
    };
    let middle = (*origin - view.eye).dot(view.ahead());
    let reach = fades * f64::from(*fade);
    (near.clamp(middle - reach, middle + reach), far.clamp(middle - reach, middle + reach))
}

/// Whether a fading ground hides nothing from rays that meet it far in front of the liquid, where it has faded into the
/// environment: they lead down, and neither liquid nor another solid is beneath it, by more than `tolerance`, m.
fn hides_nothing(
    ground: &Solid,
    view: &View,
    scene: &Scene,
    splats: &Splats,
    tolerance: f64,
) -> bool {
    let Shape::Plane { origin, normal, .. } = ground.shape else { return false };
    let normal = normal.as_dvec3();
    let up = normal * (view.eye - origin).dot(normal).signum();
    let is_above = |place: DVec3, reach: f64| (place - origin).dot(up) >= reach - tolerance;
    let is_solid_above = |solid: &Solid| match solid.shape.corners() {
        Some(corners) => corners.into_iter().all(|corner| is_above(corner, 0.0)),
        None => std::ptr::eq(solid, ground),
    };
    let is_splat_above = |splat: Splat| {
        is_above(splats.origin + Vec3::from_array(splat.centre).as_dvec3(), splat.longest())
    };
    view.ahead().dot(up) <= 0.0
        && scene.solids.iter().all(is_solid_above)
        && splats.outline().all(is_splat_above)
}

/// Moves a default near plane in front of the liquid, if the eye is outside the liquid but nearer to
/// it than that plane. Otherwise the liquid would count as surrounding the eye: a low eye with a far
/// target would look out of the water.
pub(crate) fn clear_of_liquid(
    view: View,
    splats: &Splats,
    blocks: &Blocks,
    size: UVec2,
    support: f32,
) -> View {
    /// Near plane over the distance to the liquid, less than 1 because smoothing may move a surface nearer.
    const NEAR_SHARE: f64 = 0.5;
    /// Least near plane, over the origin's distance and over a radius: any nearer, 32-bit floats cannot
    /// distinguish the near and far sides of splats.
    const MIN_SHARES: (f64, f64) = (1e-6, 1e-3);
    if view.near.is_some() || view.is_orthographic() {
        return view;
    }
    let uniform = view.uniform(size, splats.origin, 0.0);
    let eye = view.eye - splats.origin;
    let ahead = view.ahead();
    // Distance from the eye to the near plane's farthest corner, per unit of depth.
    let corner = f64::from(farthest_corner(&uniform));
    let farthest = corner * f64::from(uniform.near);
    let clearance = |splat: &Splat| {
        let offset = Vec3::from_array(splat.centre).as_dvec3() - eye;
        let (distance, reach) = (offset.length(), splat.longest());
        if distance - reach >= farthest || offset.dot(ahead) + reach <= 0.0 {
            return f64::INFINITY;
        }
        let to_sphere = splat.axes().inverse();
        // A distance in world space is at least the one in sphere space over the norm.
        let norm = to_sphere.to_cols_array().map(|x| x * x).iter().sum::<f64>().sqrt();
        (((to_sphere * offset).length() - 1.0) / norm).max(distance - reach)
    };
    let near = |block: &Block| block.distance(eye) - f64::from(block.longest) < farthest;
    if let Some(device) = &splats.device {
        // Among the splats the host does not know how near the nearest is: half a radius at least.
        let distance = device.distance(eye).max(f64::from(splats.radius));
        let least = (MIN_SHARES.0 * eye.length()).max(MIN_SHARES.1 * f64::from(splats.radius));
        let near = (NEAR_SHARE * distance / corner).max(least) as f32;
        return View { near: Some(near.min(uniform.near)), ..view };
    }
    let nearest = blocks.splats_where(splats, near).map(clearance).fold(f64::INFINITY, f64::min);
    if nearest >= farthest || nearest <= 0.0 || classify::is_inside(splats, eye, support) {
        return view;
    }
    let least = (MIN_SHARES.0 * eye.length()).max(MIN_SHARES.1 * f64::from(splats.radius));
    let near = (NEAR_SHARE * nearest / corner).max(least) as f32;
    View { near: Some(near.min(uniform.near)), ..view }
}

/// Distance of the picture's farthest corner at depth 1.
fn farthest_corner(uniform: &CameraUniform) -> f32 {
    (uniform.tangent + uniform.shift.abs()).extend(1.0).length()
}

/// Depth of the farthest liquid in a view, m.
pub(crate) fn farthest_depth(splats: &Splats, view: &View) -> f64 {
    if !view.is_orthographic() {
        return 0.0;
    }
    let (from_eye, ahead) = (splats.origin - view.eye, view.ahead());
    let depth = |splat: &Splat| {
        let centre = Vec3::from_array(splat.centre).as_dvec3();
        (from_eye + centre).dot(ahead) + splat.longest()
    };
    let all = splats.aggregates.par_iter().chain(&splats.splashes);
    let on_device = splats.device.iter().flat_map(DeviceSplats::corners);
    let on_device = on_device.map(|corner| depth(&corner)).fold(0.0, f64::max);
    // Smoothing may move a surface back.
    let margin = 4.0 * f64::from(splats.radius);
    all.map(depth).reduce(|| on_device, f64::max) + margin.max(1e-3 * view.focus)
}

/// Whether a pixel's ray may start inside the liquid. It then leaves through a back, even if rays are
/// followed through one interface only.
pub(crate) fn may_start_inside(splats: &Splats, blocks: &Blocks, view: &View, size: UVec2) -> bool {
    let (from_eye, ahead) = (splats.origin - view.eye, view.ahead());
    if view.is_orthographic() {
        let near = f64::from(view.near());
        let ends = |splat: Splat| {
            let depth = (from_eye + Vec3::from_array(splat.centre).as_dvec3()).dot(ahead);
            let reach = 1.001 * splat.longest();
            (depth - reach, depth + reach)
        };
        if splats.device.is_some() {
            let wider = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
            let all = splats.outline().map(ends).fold((f64::INFINITY, f64::NEG_INFINITY), wider);
            return all.0 <= near && near <= all.1;
        }
        return splats.outline().map(ends).any(|(first, last)| first <= near && near <= last);
    }
    let uniform = view.uniform(size, splats.origin, 0.0);
    // Distance from the eye to the near plane's corners, with a margin for planes at grazing angles.
    let near = 32.0 * uniform.near * farthest_corner(&uniform);
    let eye = -uniform.origin.as_dvec3();
    // With a margin for rounding below.
    let beside = 1.01 * f64::from(near) + 1e-5 * eye.length();
    if let Some(device) = &splats.device {
        return device.distance(eye) <= beside;
    }
    let reaches = |block: &Block| block.distance(eye) <= 1.01 * f64::from(block.longest) + beside;
    blocks.splats_where(splats, reaches).any(|splat| {
        (uniform.origin + Vec3::from_array(splat.centre)).length()
            <= 1.001 * splat.longest() as f32 + near
    })
}

/// Depth of the eye below the liquid's surface, m: up to the highest particle near the vertical through
/// the eye; 0 if there is none. `origin` is the splats' origin relative to the eye.
pub(crate) fn depth_below_surface(splats: &Splats, origin: Vec3) -> f32 {
    let height = |splat: &Splat| {
        let centre = origin + Vec3::from_array(splat.centre);
        let near = centre.xz().length() <= 2.0 * splat.radius;
        if near { centre.y + splat.radius } else { 0.0 }
    };
    splats.aggregates.par_iter().map(height).reduce(|| 0.0, f32::max)
}
