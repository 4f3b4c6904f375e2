//! Extreme scenes: any scale, place, field of view and index, against a closed form.
//!
//! The liquid is one ellipsoid, which a single splat draws exactly; so what differs from the truth
//! is arithmetic, and what screen space cannot see.

use glam::{DMat3, DQuat, DVec3, UVec2};

use super::rows::Stress;
use crate::camera::Camera;
use crate::environment::Environment;
use crate::error::Result;
use crate::gpu::{self, Gpu};
use crate::passes::classify::{Splat, Splats};
use crate::reference::analytic::Ellipsoid;
use crate::reference::trace::trace;
use crate::renderer::{Picture, Renderer};
use crate::scene::{Liquid, Scene, Shape, Solid, Surface};
use crate::settings::Settings;
use crate::waves::splitmix64;

/// What a case varies; all else is moderate.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Case {
    Scale,
    Offset,
    FieldOfView,
    Index,
    Grazing,
    All,
}

const CASES: [(Case, &str); 6] = [
    (Case::Scale, "scale 1e-3 to 1e4 m"),
    (Case::Offset, "offset to 1e5 m"),
    (Case::FieldOfView, "field of view 5° to 150°"),
    (Case::Index, "index 1.0003 to 2.4, and 1/1.33"),
    (Case::Grazing, "views along the floor"),
    (Case::All, "all at once"),
];

/// Draws `pictures` of each case.
///
/// # Errors
/// As [`Renderer::render`].
pub fn measure(gpu: &Gpu, renderer: &mut Renderer, pictures: u32) -> Result<Vec<Stress>> {
    let size = UVec2::new(96, 72);
    let target = Picture::new(gpu, size)?;
    renderer.timing = false;
    let mut rows = Vec::new();
    for (index, (case, name)) in CASES.into_iter().enumerate() {
        let mut errors = Vec::new();
        let mut not_finite = 0;
        for number in 0..pictures {
            let mut state = (index as u64) << 32 | u64::from(number);
            let trial = Trial::new(case, &mut state);
            let (scene, camera, splats) = trial.frame();
            renderer.render(&scene, &camera, &splats, &target.view(), Picture::FORMAT, size)?;
            let radiance = &renderer.images().radiance.texture;
            let texels = gpu::read_texture(gpu, radiance, 0)?;
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
        let Some((worst_error, worst)) = errors.last().copied() else { continue };
        rows.push(Stress {
            case: name.into(),
            pictures,
            not_finite,
            median_error: errors[errors.len() / 2].0,
            worst_error,
            worst: worst.to_string(),
        });
    }
    Ok(rows)
}

/// One extreme scene.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Trial {
    scale: f64,
    offset: DVec3,
    fov_y: f64,
    ior: f64,
    /// Height of the eye above the floor's horizon, as an angle, rad.
    elevation: f64,
    azimuth: f64,
    axes: DVec3,
    turn: DQuat,
}

impl std::fmt::Display for Trial {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { scale, offset, fov_y, ior, elevation, .. } = self;
        let (degrees, offset) = (elevation.to_degrees(), offset.length());
        write!(f, "scale {scale:.3e} m, offset {offset:.3e} m, fov {fov_y:.1}°, index {ior:.4}, ")?;
        write!(f, "eye {degrees:.2}° above the floor")
    }
}

impl Trial {
    fn new(case: Case, state: &mut u64) -> Self {
        let mut unit = || splitmix64(state);
        let varies = |which: Case| case == which || case == Case::All;
        let direction = |a: f64, b: f64| {
            let z = 2.0 * a - 1.0;
            let (sin, cos) = (std::f64::consts::TAU * b).sin_cos();
            DVec3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z)
        };
        // Every number is drawn in every case, so that cases differ in what they vary alone.
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
        Self { scale, offset, fov_y, ior, elevation, azimuth, axes, turn }
    }

    fn shape(&self) -> DMat3 {
        let turn = DMat3::from_quat(self.turn);
        turn * DMat3::from_diagonal(self.scale * self.axes) * turn.transpose()
    }

    fn liquid(&self) -> Ellipsoid {
        Ellipsoid::new(self.offset, self.shape()).expect("its axes are not zero")
    }

    fn frame(&self) -> (Scene, Camera, Splats) {
        let floor = self.offset - 1.2 * self.scale * DVec3::Y;
        // So far that the ellipsoid fills about half of the picture.
        let distance = self.scale * (1.0 / (0.5 * self.fov_y.to_radians()).tan()).max(0.6) * 1.5;
        let (sin, cos) = self.elevation.sin_cos();
        let towards = DVec3::new(cos * self.azimuth.cos(), sin, cos * self.azimuth.sin());
        let camera = Camera {
            eye: self.offset + (distance + 1.2 * self.scale) * towards,
            target: self.offset,
            up: glam::Vec3::Y,
            fov_y: self.fov_y as f32,
            near: None,
        };
        let color = |r, g, b| glam::Vec3::new(r, g, b);
        let scene = Scene {
            liquid: Liquid {
                ior: self.ior as f32,
                absorption: color(0.6, 0.3, 0.1) / self.scale as f32,
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
            particles: None,
            fluids: Vec::new(),
            recipe: None,
            simulation: None,
            camera: None,
            views: Vec::new(),
            lights: Vec::new(),
            settings: Settings::default(),
        };
        let [x, y, z] = [0, 1, 2].map(|i| self.shape().col(i).as_vec3());
        let splat = Splat {
            centre: [0.0; 3],
            radius: self.scale as f32,
            diagonal: [x.x, y.y, z.z],
            particle: 0,
            off_diagonal: [x.y, x.z, y.z],
            tags: 0,
        };
        let splats = Splats {
            splashes: vec![splat],
            radius: 0.1 * self.scale as f32,
            origin: self.offset,
            ..Splats::default()
        };
        (scene, camera, splats)
    }
}
