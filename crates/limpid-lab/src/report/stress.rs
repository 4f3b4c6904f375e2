//! Extreme scenes: any scale, position, field of view and index of refraction, against a closed
//! form.
//!
//! The liquid is made of separate ellipsoids, each of which one splat renders exactly; any
//! difference from the truth is due to rounding or to the limits of screen space.

use glam::{DMat3, DQuat, DVec3, UVec2};

use super::rows::Stress;
use crate::reference::analytic::{Drops, Ellipsoid};
use crate::reference::trace::trace;
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::liquid::classify::{Splat, Splats};
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::scene::{Liquid, Scene, Shape, Solid, Surface};
use limpid_io::error::Result;
use limpid_sim::rng::splitmix64;

/// The parameter that a case varies; all others are moderate.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Case {
    Scale,
    Offset,
    FieldOfView,
    Index,
    Grazing,
    All,
    Spray,
    Pool,
    Beside,
    Within,
}

const CASES: [(Case, &str); 10] = [
    (Case::Scale, "scale 1e-3 to 1e4 m"),
    (Case::Offset, "offset to 1e5 m"),
    (Case::FieldOfView, "field of view 5° to 150°"),
    (Case::Index, "index 1.0003 to 2.4, and 1/1.33"),
    (Case::Grazing, "views along the floor"),
    (Case::All, "all at once"),
    (Case::Spray, "spray: forty separate droplets"),
    (Case::Pool, "a pool that goes on beyond the picture and behind the eye"),
    (Case::Beside, "droplets beside the eye"),
    (Case::Within, "the eye in the liquid"),
];

/// Number of droplets in spray, and next to the eye.
const DROPLETS: [usize; 2] = [40, 12];

/// Renders `pictures` pictures of each case and compares them with the truth.
///
/// # Errors
/// As [`Renderer::render`].
pub fn measure(gpu: &Gpu, renderer: &mut Renderer, pictures: u32) -> Result<Vec<Stress>> {
    let size = UVec2::new(96, 72);
    let target = Picture::new(gpu, size)?;
    let mut rows = Vec::new();
    for (index, (case, name)) in CASES.into_iter().enumerate() {
        let mut errors = Vec::new();
        let mut not_finite = 0;
        for number in 0..pictures {
            let mut state = (index as u64) << 32 | u64::from(number);
            let trial = Trial::new(case, number, &mut state);
            let (scene, camera, splats) = trial.frame();
            renderer.render(FrameInput::new(&scene, &camera, &splats, size), &target)?;
            let radiance = &renderer.images().radiance.texture;
            let texels = gpu.read_texture(radiance, 0)?;
            let texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&texels);
            not_finite += texels.iter().filter(|t| !t.iter().all(|c| c.is_finite())).count() as u64;
            let truth = trace(&trial.liquid(), &scene, &camera, size, 1, 24);
            let difference: f64 = texels
                .iter()
                .zip(&truth.pixels)
                .map(|(t, truth)| {
                    let drawn = DVec3::new(t[0].into(), t[1].into(), t[2].into());
                    (drawn - *truth).abs().element_sum() / 3.0
                })
                .filter(|d| d.is_finite())
                .sum();
            errors.push((difference / texels.len() as f64, trial));
        }
        errors.sort_by(|a, b| a.0.total_cmp(&b.0));
        let Some((worst_error, worst)) = errors.last() else { continue };
        rows.push(Stress {
            case: name.into(),
            pictures,
            not_finite,
            median_error: errors[errors.len() / 2].0,
            worst_error: *worst_error,
            worst: worst.to_string(),
        });
    }
    Ok(rows)
}

/// One extreme scene.
#[derive(Debug, Clone, PartialEq)]
struct Trial {
    case: Case,
    number: u32,
    scale: f64,
    offset: DVec3,
    fov_y: f64,
    ior: f64,
    /// Elevation of the eye above the floor's horizon, rad.
    elevation: f64,
    azimuth: f64,
    drops: Vec<Drop>,
}

/// An ellipsoid of liquid; lengths in units of the scene's scale.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Drop {
    centre: DVec3,
    axes: DVec3,
    turn: DQuat,
}

impl Drop {
    /// The matrix that maps the unit sphere to the ellipsoid around its centre.
    fn shape(&self) -> DMat3 {
        let turn = DMat3::from_quat(self.turn);
        turn * DMat3::from_diagonal(self.axes) * turn.transpose()
    }

    /// Whether the bounding spheres of both are disjoint, with some room between them.
    fn is_apart(&self, other: &Self) -> bool {
        let radii = self.axes.max_element() + other.axes.max_element();
        self.centre.distance(other.centre) > 1.05 * radii
    }
}

/// Distance of the floor below the liquid's centre, in units of the scene's scale.
const FLOOR: f64 = 1.2;

impl std::fmt::Display for Trial {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { number, scale, offset, fov_y, ior, elevation, .. } = self;
        let (degrees, offset) = (elevation.to_degrees(), offset.length());
        write!(
            f,
            "number {number}, scale {scale:.3e} m, offset {offset:.3e} m, fov {fov_y:.1}°, index {ior:.4}, "
        )?;
        write!(f, "eye {degrees:.2}° above the floor")
    }
}

impl Trial {
    fn new(case: Case, number: u32, state: &mut u64) -> Self {
        let mut unit = || splitmix64(state);
        let varies = |which: Case| case == which || case == Case::All;
        let direction = |a: f64, b: f64| {
            let z = 2.0 * a - 1.0;
            let (sin, cos) = (std::f64::consts::TAU * b).sin_cos();
            DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
        };
        // Every case draws all random numbers, so that cases differ only in what they vary.
        let exponent = -3.0 + 7.0 * unit();
        let scale = if varies(Case::Scale) { 10f64.powf(exponent) } else { 1.0 };
        let place = direction(unit(), unit()) * 10f64.powf(5.0 * unit());
        let offset = if varies(Case::Offset) { place } else { DVec3::ZERO };
        let fov = 5.0 * 30f64.powf(unit());
        let fov_y = if varies(Case::FieldOfView) { fov } else { 40.0 };
        let index =
            if unit() < 0.2 { 1.0 / 1.33 } else { 1.0 + 3e-4 * (1.4 / 3e-4f64).powf(unit()) };
        let ior = if varies(Case::Index) { index } else { 1.33 };
        let (low, high) = (1e-3 * 30f64.powf(unit()), 0.2 + 0.8 * unit());
        let elevation = if varies(Case::Grazing) { low } else { high };
        let azimuth = std::f64::consts::TAU * unit();
        let axes = DVec3::new(unit(), unit(), unit()) * 0.7 + 0.3;
        let turn = DQuat::from_axis_angle(direction(unit(), unit()), 3.0 * unit());
        let body = Drop { centre: DVec3::ZERO, axes, turn };
        let drops = vec![body];
        let mut trial = Self { case, number, scale, offset, fov_y, ior, elevation, azimuth, drops };
        let mut droplet = |place: &dyn Fn(DVec3) -> DVec3| {
            let centre = place(DVec3::new(unit(), unit(), unit()) * 2.0 - 1.0);
            let axes = (DVec3::new(unit(), unit(), unit()) * 0.5 + 0.5) * (0.04 + 0.1 * unit());
            let turn = DQuat::from_axis_angle(direction(unit(), unit()), 3.0 * unit());
            Drop { centre, axes, turn }
        };
        match case {
            Case::Spray => {
                trial.drops.clear();
                while trial.drops.len() < DROPLETS[0] {
                    trial.add(droplet(&|x| x));
                }
            }
            Case::Pool => {
                // Half of the pool is below the floor: a surface that nearly touches the floor is
                // wet by one convention and dry by the other.
                let wide = 20.0 * axes + 10.0;
                let centre = DVec3::new(0.0, -FLOOR, 0.0);
                let axes = DVec3::new(wide.x, 0.1 + 0.4 * axes.y, wide.z);
                trial.drops = vec![Drop { centre, axes, turn: DQuat::from_rotation_y(azimuth) }];
            }
            Case::Beside => {
                // Within the slab around the camera's plane, on all sides of the eye.
                let (eye, towards) = (trial.eye(), trial.towards());
                let right = DVec3::Y.cross(towards).normalize();
                let (up, plane) = (towards.cross(right), 0.04);
                while trial.drops.len() < 1 + DROPLETS[1] {
                    let drop = droplet(&|x| eye + x.x * right + x.y * up + plane * x.z * towards);
                    if drop.centre.distance(eye) > 2.0 * drop.axes.max_element() {
                        trial.add(drop);
                    }
                }
            }
            Case::Within => {
                let aside = 0.5 * axes.min_element() * (DVec3::new(unit(), unit(), unit()) - 0.5);
                trial.drops = vec![Drop { centre: trial.eye() + aside, ..body }];
            }
            _ => {}
        }
        trial
    }

    /// Adds a droplet if it is apart from all others.
    fn add(&mut self, drop: Drop) {
        if self.drops.iter().all(|other| other.is_apart(&drop)) {
            self.drops.push(drop);
        }
    }

    /// The direction from the liquid to the eye.
    fn towards(&self) -> DVec3 {
        let (sin, cos) = self.elevation.sin_cos();
        DVec3::new(cos * self.azimuth.cos(), sin, cos * self.azimuth.sin())
    }

    /// The position of the eye relative to the liquid's centre, in units of the scale: at a
    /// distance at which a unit ellipsoid fills about half of the picture.
    fn eye(&self) -> DVec3 {
        let distance = (1.0 / (0.5 * self.fov_y.to_radians()).tan()).max(0.6) * 1.5;
        (distance + FLOOR) * self.towards()
    }

    fn liquid(&self) -> Drops {
        let drop = |drop: &Drop| {
            let centre = self.offset + self.scale * drop.centre;
            Ellipsoid::new(centre, self.scale * drop.shape()).expect("its axes are not zero")
        };
        Drops(self.drops.iter().map(drop).collect())
    }

    fn frame(&self) -> (Scene, Camera, Splats) {
        let floor = self.offset - FLOOR * self.scale * DVec3::Y;
        let camera = Camera {
            eye: self.offset + self.scale * self.eye(),
            target: self.offset,
            up: glam::Vec3::Y,
            fov_y: self.fov_y as f32,
            near: None,
            lens: None,
        };
        let color = |r, g, b| glam::Vec3::new(r, g, b);
        let scene = Scene {
            liquid: Liquid {
                ior: self.ior as f32,
                absorption: color(0.6, 0.3, 0.1) / self.scale as f32,
                ..Liquid::default()
            },
            environment: Environment::Gradient {
                zenith: color(0.2, 0.4, 0.9),
                horizon: color(0.8, 0.8, 0.8),
                nadir: color(0.3, 0.3, 0.2),
            },
            solids: vec![Solid {
                shape: Shape::Plane {
                    origin: floor,
                    normal: glam::Vec3::Y,
                    half_extent: 1e3 * self.scale as f32,
                },
                surface: Surface::Color(color(0.5, 0.4, 0.3)),
                lit: false,
            }],
            ..Scene::default()
        };
        let splat = |drop: &Drop| {
            let [x, y, z] = drop
                .shape()
                .to_cols_array_2d()
                .map(|column| (self.scale * DVec3::from_array(column)).as_vec3());
            Splat {
                centre: (self.scale * drop.centre).as_vec3().to_array(),
                radius: (self.scale * drop.axes.max_element()) as f32,
                diagonal: [x.x, y.y, z.z],
                particle: 0,
                off_diagonal: [x.y, x.z, y.z],
                tags: 0,
            }
        };
        let splats = Splats {
            splashes: self.drops.iter().map(splat).collect(),
            radius: 0.1 * self.scale as f32,
            origin: self.offset,
            ..Splats::default()
        };
        (scene, camera, splats)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::Liquid as _;

    /// The cases contain what their names say: spray is separate droplets; a pool continues behind
    /// the eye; droplets next to the eye straddle the camera's plane without containing the eye;
    /// the last case has the eye in the liquid.
    #[test]
    fn cases_match_their_names() {
        for number in 0..50 {
            let trial = |case| Trial::new(case, number, &mut u64::from(number));
            let apart = |trial: &Trial| {
                let pairs = trial.drops.iter().enumerate();
                pairs
                    .flat_map(|(i, a)| trial.drops[..i].iter().map(move |b| (a, b)))
                    .all(|(a, b)| a.is_apart(b))
            };
            let spray = trial(Case::Spray);
            assert!(spray.drops.len() == 40 && apart(&spray));
            let pool = trial(Case::Pool);
            let behind = (2.0 * pool.eye()).with_y(pool.drops[0].centre.y);
            assert!(pool.liquid().contains(pool.offset + pool.scale * behind));
            let beside = trial(Case::Beside);
            let (eye, towards) = (beside.eye(), beside.towards());
            let across =
                |drop: &&Drop| (drop.centre - eye).dot(towards).abs() < drop.axes.min_element();
            assert!(beside.drops.len() == 13 && apart(&beside));
            assert!(beside.drops.iter().filter(across).count() > 2);
            for (trial, within) in [(&spray, false), (&pool, false), (&beside, false)]
                .into_iter()
                .chain([(&trial(Case::Within), true)])
            {
                let (_, camera, _) = trial.frame();
                assert_eq!(trial.liquid().contains(camera.eye), within, "{trial:?}");
            }
        }
    }
}
