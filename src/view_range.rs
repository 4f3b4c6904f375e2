//! Where the liquid lies along a view: the range that 32-bit floats can draw, near and far planes, and whether the
//! eye is inside.

use glam::{UVec2, Vec3, Vec3Swizzles as _};
use rayon::prelude::*;

use crate::camera::{CameraUniform, View};
use crate::error::{Error, Result};
use crate::liquid::classify::{self, Splat, Splats};

/// Fails if the product of a splat's axes and its distance, squared, leaves the range of 32-bit
/// floats: the liquid would be invisible.
pub(crate) fn check_scale(splats: &Splats, view: &View) -> Result<()> {
    /// Range of radius times distance, m²; pictures are correct up to both ends.
    const PRODUCTS: std::ops::RangeInclusive<f64> = 1e-18..=1e18;
    let (radius, distance) = (f64::from(splats.radius), view.focus);
    let empty = splats.aggregates.is_empty() && splats.splashes.is_empty();
    if empty || PRODUCTS.contains(&(radius * distance)) {
        return Ok(());
    }
    let problem = format!(
        "a particle radius of {radius:e} m seen from {distance:e} m cannot be drawn: their product must be \
         1e-18 to 1e18 m²; choose another unit of length"
    );
    Err(Error::invalid("particles", problem))
}

/// Moves a default near plane in front of the liquid, if the eye is outside the liquid but nearer to
/// it than that plane. Otherwise the liquid would count as surrounding the eye: a low eye with a far
/// target would look out of the water.
pub(crate) fn clear_of_liquid(view: View, splats: &Splats, size: UVec2, support: f32) -> View {
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
    let all = splats.aggregates.par_iter().chain(&splats.splashes);
    let nearest = all.map(clearance).reduce(|| f64::INFINITY, f64::min);
    let outside = nearest > 0.0 && !classify::is_inside(splats, eye, support);
    if nearest >= farthest || !outside {
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
    // Smoothing may move a surface back.
    let margin = 4.0 * f64::from(splats.radius);
    all.map(depth).reduce(|| 0.0, f64::max) + margin.max(1e-3 * view.focus)
}

/// Whether a pixel's ray may start inside the liquid. It then leaves through a back, even if rays are
/// followed through one interface only.
pub(crate) fn may_start_inside(splats: &Splats, view: &View, size: UVec2) -> bool {
    let (from_eye, ahead) = (splats.origin - view.eye, view.ahead());
    if view.is_orthographic() {
        return splats.aggregates.iter().chain(&splats.splashes).any(|splat| {
            let depth = (from_eye + Vec3::from_array(splat.centre).as_dvec3()).dot(ahead);
            (depth - f64::from(view.near())).abs() <= 1.001 * splat.longest()
        });
    }
    let uniform = view.uniform(size, splats.origin, 0.0);
    // Distance from the eye to the near plane's corners, with a margin for planes at grazing angles.
    let near = 32.0 * uniform.near * farthest_corner(&uniform);
    splats.aggregates.iter().chain(&splats.splashes).any(|splat| {
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
