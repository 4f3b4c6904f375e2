//! Ground truth for intersectors, in f64: where rays end, and how answers are scored.

use glam::{DMat4, DVec2, DVec3, IVec2, UVec2};
use rayon::prelude::*;

use crate::reference::layers::{Layer, LayerHit, Pair, ViewSpace, exit};
use crate::reference::surroundings::Surroundings;
use crate::reference::trace::first_last;
use crate::reference::{Ray, optics};
use crate::report::subjects::Subject;
use limpid::camera::{Camera, CameraUniform};
use limpid::scene::Scene;

/// The surfaces that rays are intersected with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// The liquid's own layers, from inside.
    Liquid,
    /// The opaque scene.
    Solids,
}

/// Texels of the layers of one view, in the device's format.
#[derive(Debug, Clone)]
pub struct ViewLayers {
    /// Pixels.
    pub size: UVec2,
    /// Front and back of the aggregates.
    pub aggregate: [Vec<[f32; 4]>; 2],
    /// Front and back of the splashes, if any.
    pub splash: Option<[Vec<[f32; 4]>; 2]>,
    /// The opaque scene.
    pub solids: Vec<[f32; 4]>,
}

/// The true end of a pixel's ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Truth {
    /// No liquid at this pixel.
    None,
    /// Not shown by the layers: hidden, or outside the picture.
    Unsolvable,
    /// At a point shown by the layers.
    Hit(LayerHit),
}

/// One method's result at a pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Answer {
    /// No liquid at this pixel.
    None,
    /// The method gave up.
    Missed,
    /// Pixel position and depth.
    Hit(DVec2, f64),
}

/// The score of a method.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Score {
    /// Pixels with liquid.
    pub rays: u64,
    /// Of these, rays whose true hit the layers show.
    pub solvable: u64,
    /// Of these, hits within a pixel of the truth and consistent in depth.
    pub solved: u64,
    /// Wrong hits: of unsolvable rays, or more than two pixels off, or inconsistent in depth.
    pub wrong: u64,
    /// Rays with a wrong answer, each counted once: solvable rays that were not solved, and hits of
    /// unsolvable rays.
    pub failed: u64,
    /// Root mean square distance of the solved hits from the truth, pixels.
    pub rms_px: f64,
}

impl Score {
    /// Share of the solvable rays that were solved.
    pub fn solved_of_solvable(&self) -> f64 {
        self.solved as f64 / self.solvable.max(1) as f64
    }

    /// Share of all rays that were solved.
    pub fn solved_of_all(&self) -> f64 {
        self.solved as f64 / self.rays.max(1) as f64
    }

    /// Share of all rays with a wrong answer.
    pub fn rays_wrong(&self) -> f64 {
        self.failed as f64 / self.rays.max(1) as f64
    }

    /// Share of all rays with a wrong hit.
    pub fn wrong_accepts(&self) -> f64 {
        self.wrong as f64 / self.rays.max(1) as f64
    }
}

/// Tolerance of the quantity that is linear on the screen, disparity or height, beyond the error of
/// a pixel offset: relative to the disparity, or to an orthographic view's width.
const DEPTH_TOLERANCE: f64 = 2e-3;

fn tolerance(view: &ViewSpace, depth: f64) -> f64 {
    DEPTH_TOLERANCE * if view.far.is_some() { 2.0 * view.tangent.x } else { 1.0 / depth }
}

/// Whether a hit that may be off by `pixels` on the screen agrees with the true one in depth.
fn consistent(view: &ViewSpace, truth: &LayerHit, u: DVec2, depth: f64, pixels: f64) -> bool {
    // Change of disparity or height per pixel along the true surface.
    let per_pixel = truth.plane.truncate() * view.tangent * 2.0 / view.size;
    let slope = per_pixel.length() * (u.distance(truth.u).min(pixels) + 0.5);
    let difference = match view.far {
        Some(_) => (depth - truth.depth).abs(),
        None => (1.0 / depth - 1.0 / truth.depth).abs(),
    };
    difference <= tolerance(view, truth.depth) + slope
}

/// Whether a hit is within a pixel of the true one and consistent with it in depth.
pub(super) fn solves(view: &ViewSpace, truth: &LayerHit, u: DVec2, depth: f64) -> bool {
    u.distance(truth.u) <= 1.0 && consistent(view, truth, u, depth, 1.0)
}

/// Scores a method's answers.
pub fn score(view: &ViewSpace, truths: &[Truth], answers: &[Answer]) -> Score {
    let mut score = Score::default();
    let mut squares = 0.0;
    for (truth, answer) in truths.iter().zip(answers) {
        if *truth == Truth::None {
            continue;
        }
        score.rays += 1;
        let Truth::Hit(hit) = truth else {
            let hit = u64::from(matches!(answer, Answer::Hit(..)));
            score.wrong += hit;
            score.failed += hit;
            continue;
        };
        score.solvable += 1;
        let Answer::Hit(u, depth) = *answer else { continue };
        let distance = u.distance(hit.u);
        if solves(view, hit, u, depth) {
            score.solved += 1;
            squares += distance * distance;
        } else if distance > 2.0 || !consistent(view, hit, u, depth, 2.0) {
            score.wrong += 1;
        }
    }
    score.failed += score.solvable - score.solved;
    score.rms_px = (squares / score.solved.max(1) as f64).sqrt();
    score
}

/// Maximum distance that a hit counts as, pixels; also that of a missing hit or one on another
/// surface.
pub const OFF: f64 = 10.0;

/// Sums the squared distances of the answers from the truth, pixels², over all solvable rays, and
/// counts these rays. Distances are clamped to [`OFF`].
pub fn hit_error(view: &ViewSpace, truths: &[Truth], answers: &[Answer]) -> (f64, u64) {
    let mut sum = (0.0, 0);
    for (truth, answer) in truths.iter().zip(answers) {
        let Truth::Hit(hit) = truth else { continue };
        let off = match *answer {
            Answer::Hit(u, depth) if consistent(view, hit, u, depth, OFF) => u.distance(hit.u),
            _ => OFF,
        };
        sum = (sum.0 + off.min(OFF).powi(2), sum.1 + 1);
    }
    sum
}

/// The refracted ray of each pixel with liquid, in view space, and the pixel.
fn rays<'a>(
    view: &'a ViewSpace,
    layers: &'a [Pair],
    ior: f64,
) -> impl IndexedParallelIterator<Item = Option<(DVec3, DVec3, IVec2)>> + 'a {
    let size = layers[0][0].size;
    (0..size.element_product()).into_par_iter().map(move |i| {
        let texel = UVec2::new(i % size.x, i / size.x).as_ivec2();
        let u = texel.as_dvec2() + 0.5;
        let omega = view.omega(u);
        let nearest = |a: DVec3, b: DVec3| if b.dot(omega) > a.dot(omega) { b } else { a };
        let front = layers.iter().map(|pair| pair[0].at(texel)).fold(DVec3::ZERO, nearest);
        let disparity = front.dot(omega);
        if disparity <= 0.0 {
            return None;
        }
        let d = optics::refract(view.ray(u).1, -view.normal(front), ior)?;
        Some((view.point(u, disparity), d, texel))
    })
}

/// Computes the true end of every pixel's ray: on the layers, or for solids in the scene itself,
/// where the ray is solvable if the layer shows its end point.
pub fn truths(
    world_from_view: &DMat4,
    uniform: &CameraUniform,
    scene: &Scene,
    layers: &ViewLayers,
    target: Target,
) -> Vec<Truth> {
    let view = ViewSpace::new(uniform);
    let size = layers.size;
    let pair = |texels: &[Vec<[f32; 4]>; 2]| texels.each_ref().map(|t| Layer::new(size, t));
    let classes: Vec<Pair> =
        [Some(&layers.aggregate), layers.splash.as_ref()].into_iter().flatten().map(pair).collect();
    let solids = Layer::new(size, &layers.solids);
    let surroundings = Surroundings::new(scene);
    rays(&view, &classes, scene.liquid.ior.into())
        .map(|ray| {
            let Some((o, d, texel)) = ray else { return Truth::None };
            if target == Target::Liquid {
                let references: Vec<_> = classes.iter().collect();
                let hit = exit(&view, &references, o, d, texel);
                return hit.map_or(Truth::Unsolvable, Truth::Hit);
            }
            let world = Ray {
                origin: world_from_view.transform_point3(o),
                direction: world_from_view.transform_vector3(d),
            };
            let Some(hit) = surroundings.hit(&world) else { return Truth::Unsolvable };
            let x = o + hit.t * d;
            let u = view.pixel(x);
            let plane = solids.at(u.floor().as_ivec2());
            let hit = LayerHit { u, depth: -x.z, plane };
            let disparity = plane.dot(view.omega(u));
            let shown = -view.point(u, disparity).z;
            let visible = x.z < -view.near
                && view.holds(u)
                && disparity > 0.0
                && match view.far {
                    Some(_) => (shown - hit.depth).abs() <= tolerance(&view, hit.depth),
                    None => (hit.depth / shown - 1.0).abs() <= DEPTH_TOLERANCE,
                };
            if visible { Truth::Hit(hit) } else { Truth::Unsolvable }
        })
        .collect()
}

/// The view-to-world transform of a camera.
pub fn world_from_view(camera: &Camera) -> DMat4 {
    let (eye, target, up) = (camera.eye, camera.target, camera.up.as_dvec3());
    glam::dcamera::rh::view::look_at_mat4(eye, target, up).inverse()
}

impl ViewLayers {
    /// Computes the exact layers of analytic water over solids: its front where no solid hides it.
    pub(super) fn exact(subject: &Subject, camera: &Camera, size: UVec2) -> Self {
        let view = ViewSpace::new(&camera.uniform(size, DVec3::ZERO));
        let surroundings = Surroundings::new(&subject.scene);
        let [front, _] = first_last(&*subject.liquid, camera, size);
        let world_from_view = world_from_view(camera);
        let eye = world_from_view.transform_point3(DVec3::ZERO);
        let texels: Vec<_> = (0..size.element_product())
            .into_par_iter()
            .map(|i| {
                let omega = view.omega(DVec2::new((i % size.x).into(), (i / size.x).into()) + 0.5);
                let direction = world_from_view.transform_vector3(omega.normalize());
                let solid =
                    surroundings.hit(&Ray { origin: eye, direction }).map_or([0.0; 4], |hit| {
                        let normal = world_from_view.inverse().transform_vector3(hit.normal);
                        texel(hit.t * omega.normalize(), normal)
                    });
                let depth = front.depths[i as usize];
                let hidden = solid[3] > 0.0 && f64::from(solid[3]) < depth;
                let water = match depth > 0.0 && !hidden {
                    true => texel(depth * omega, front.normals[i as usize]),
                    false => [0.0; 4],
                };
                (water, solid)
            })
            .collect();
        let (water, solids): (Vec<_>, _) = texels.into_iter().unzip();
        let none = vec![[0.0; 4]; water.len()];
        Self { size, aggregate: [water, none], splash: None, solids }
    }
}

/// The texel of the plane through `x` with `normal`, in view space.
fn texel(x: DVec3, normal: DVec3) -> [f32; 4] {
    let plane = normal / normal.dot(x);
    [plane.x as f32, plane.y as f32, plane.z as f32, -x.z as f32]
}
