//! Turbid liquids, against a path tracer in 64 bits and closed forms.

use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::glam::{DVec3, UVec2, Vec3};
use limpid::liquid::classify::Splats;
use limpid::scene::{Light, Medium, Scene};
use limpid_lab::reference::Ray;
use limpid_lab::reference::analytic::Block;
use limpid_lab::reference::turbid::radiance_along;

mod lit_slab;

use lit_slab::LitSlab;

use crate::support::frames::{
    ellipsoid, harness, noise_turn, noise_vector, on_axis, scene, sphere, splats,
};

/// Odd, so that the middle pixel's ray is the camera's axis.
const SIZE: UVec2 = UVec2::new(33, 33);
const MIDDLE: UVec2 = UVec2::new(16, 16);
/// Half the thickness of the slab, m.
const HALF: f32 = 0.25;

fn turbid(absorption: Vec3, scattering: Vec3, anisotropy: f32) -> Scene {
    let mut scene = scene();
    let medium = Medium { absorption, scattering, anisotropy };
    scene.liquid = scene.liquid.with(medium);
    scene
}

/// Media of one extinction, 1/m, and these albedos.
fn of_albedos(extinction: f32, albedos: Vec3, anisotropy: f32) -> Scene {
    turbid(extinction * (1.0 - albedos), extinction * albedos, anisotropy)
}

/// A sky of radiance 1 above, and darkness below.
fn sky() -> Environment {
    let size = UVec2::new(4, 64);
    let row = |y| if y < 32 { [1.0, 1.0, 1.0, 1.0] } else { [0.0, 0.0, 0.0, 1.0] };
    let pixels = (0..size.y).flat_map(|y| [row(y); 4]).collect();
    Environment::Map { size, pixels }
}

/// Cosines of Gauss and Legendre's quadrature from 0 to 1, and twice cosine times weight.
fn angles() -> [(f64, f64); 3] {
    let x = 0.6f64.sqrt();
    [(-x, 5.0 / 18.0), (0.0, 4.0 / 9.0), (x, 5.0 / 18.0)].map(|(x, weight)| {
        let cos = 0.5 + 0.5 * x;
        (cos, 2.0 * cos * weight)
    })
}

/// Paths of the tracer that tell a flux to about 1 %.
fn paths(flux: f64) -> u32 {
    (1e4 / flux).clamp(4e4, 4e6) as u32
}

/// A camera that looks at the middle of a slab from above (1) or below (−1).
fn towards(cos: f64, side: f64) -> Camera {
    let eye = 6.0 * DVec3::new((1.0 - cos * cos).sqrt(), side * cos, 0.0);
    Camera { eye, target: DVec3::ZERO, up: Vec3::Z, fov_y: 2.0, near: None, lens: None }
}

/// Flux that a level slab reflects and transmits of the light of a sky, as drawn and as traced.
#[test]
fn slabs_reflect_and_transmit_as_traced() {
    let Some(mut harness) = harness() else { return };
    let slab = splats(
        &[ellipsoid(Vec3::ZERO, Vec3::new(60.0, HALF, 60.0), Default::default())],
        &[],
        0.02,
    );
    let half = f64::from(HALF);
    let exact = Block {
        min: DVec3::new(f64::NEG_INFINITY, -half, f64::NEG_INFINITY),
        max: DVec3::new(f64::INFINITY, half, f64::INFINITY),
    };
    for (extinction, anisotropy) in [(2.0, 0.0), (10.0, 0.0), (10.0, 0.7)] {
        for albedos in [Vec3::new(0.2, 0.6, 0.9), Vec3::splat(0.99)] {
            let mut scene = of_albedos(extinction, albedos, anisotropy);
            scene.environment = sky();
            for side in [1.0, -1.0] {
                let (mut drawn, mut traced) = (DVec3::ZERO, DVec3::ZERO);
                for (cos, weight) in angles() {
                    let camera = towards(cos, side);
                    let image = harness.render(&scene, &camera, &slab, SIZE);
                    drawn += weight * image.radiance(MIDDLE);
                }
                for (cos, weight) in angles() {
                    let eye = towards(cos, side).eye;
                    let ray = Ray { origin: eye, direction: -eye.normalize() };
                    let samples = paths(drawn.min_element());
                    traced += weight * radiance_along(&exact, &scene, &ray, samples);
                }
                let off = (drawn / traced.max(DVec3::splat(1e-9)) - 1.0).abs();
                let text = format!(
                    "{extinction}/m, {anisotropy}, {albedos}, side {side}: {drawn} {traced}"
                );
                println!("{text}");
                assert!(off.cmplt(DVec3::splat(0.03)).all(), "{text}");
            }
        }
    }
}

/// The tracer finds the transmittance of white slabs without boundaries: Heaslet and Warming (1965), table 1.
#[test]
fn the_tracer_transmits_as_tabulated() {
    let block = |half: f64| Block {
        min: DVec3::new(f64::NEG_INFINITY, -half, f64::NEG_INFINITY),
        max: DVec3::new(f64::INFINITY, half, f64::INFINITY),
    };
    let mut scene = of_albedos(1.0, Vec3::ONE, 0.0);
    scene.liquid.ior = 1.0;
    scene.environment = sky();
    for (thickness, expected) in [(0.5, 0.7040), (1.0, 0.5532), (2.0, 0.3900)] {
        let flux: DVec3 = (0..16)
            .map(|i| {
                let cos = (f64::from(i) + 0.5) / 16.0;
                let ray = Ray {
                    origin: 9.0 * DVec3::NEG_Y,
                    direction: DVec3::new((1.0 - cos * cos).sqrt(), cos, 0.0),
                };
                2.0 * cos / 16.0 * radiance_along(&block(0.5 * thickness), &scene, &ray, 20_000)
            })
            .sum();
        assert!((flux.x - expected).abs() < 5e-3, "{thickness}: {flux}");
    }
}

/// Light of a sun, and of a lamp two thicknesses above it, that a slab scatters.
#[test]
fn slabs_scatter_suns_and_lamps_as_traced() {
    let Some(mut harness) = harness() else { return };
    let flat = ellipsoid(Vec3::ZERO, Vec3::new(4.0, HALF, 4.0), Default::default());
    let mut slab = splats(&[flat], &[], 0.02);
    // Lights' views frame the particles' radii.
    slab.aggregates[0].radius = 4.0;
    let sun = Light::Sun { direction: -Vec3::new(0.3, 0.9, 0.3), irradiance: Vec3::splat(2.0) };
    let position = DVec3::new(0.4, 1.3, 0.3);
    let lamp = Light::Point { position, intensity: Vec3::splat(3.0) };
    for (extinction, anisotropy, albedo) in [(2.0, 0.0, 0.6), (10.0, 0.0, 0.9), (10.0, 0.6, 0.9)] {
        let mut scene = of_albedos(extinction, Vec3::splat(albedo), anisotropy);
        scene.environment = Environment::Constant(Vec3::ZERO);
        let exact = LitSlab {
            half: HALF.into(),
            ior: scene.liquid.ior.into(),
            extinction: extinction.into(),
            albedo: albedo.into(),
            anisotropy: anisotropy.into(),
        };
        for (name, light) in [("sun", sun), ("lamp", lamp)] {
            scene.lights = vec![light];
            for side in [1.0, -1.0] {
                let (mut drawn, mut traced) = (0.0, 0.0);
                for (cos, weight) in angles() {
                    let camera = towards(cos, side);
                    let image = harness.render(&scene, &camera, &slab, SIZE);
                    drawn += weight * image.radiance(MIDDLE).x;
                    let ray = Ray { origin: camera.eye, direction: -camera.eye.normalize() };
                    traced += weight * exact.radiance_along(&light, &ray, 40_000);
                }
                let text = format!(
                    "{name}: {extinction}/m, {anisotropy}, {albedo}, side {side}: {drawn} {traced}"
                );
                println!("{text}");
                let most = if name == "sun" && side > 0.0 { 0.06 } else { 0.12 };
                assert!((drawn / traced - 1.0).abs() < most, "{text}");
            }
        }
    }
}

/// Bodies that absorb nothing cannot be seen in light of one radiance from everywhere, however they scatter.
#[test]
fn white_liquids_vanish_in_a_furnace() {
    let Some(mut harness) = harness() else { return };
    let mut seed = 7;
    let pile = |_| {
        let (centre, turn) = (0.5 * noise_vector(&mut seed), noise_turn(&mut seed));
        ellipsoid(centre, Vec3::new(0.35, 0.3, 0.25), turn)
    };
    let ball = splats(&[sphere(Vec3::ZERO, 1.0)], &[], 0.05);
    let pile = splats(&(0..9).map(pile).collect::<Vec<_>>(), &[], 0.05);
    for (scattering, anisotropy) in [(0.5, 0.0), (5.0, 0.8), (60.0, 0.0)] {
        let mut scene = turbid(Vec3::ZERO, Vec3::splat(scattering), anisotropy);
        scene.environment = Environment::Constant(Vec3::ONE);
        for bodies in [&ball, &pile] {
            let images = harness.render(&scene, &on_axis(4.0, 35.0), bodies, UVec2::new(97, 73));
            images.assert_finite();
            for p in images.pixels() {
                let radiance = images.radiance(p);
                let off = (radiance - 1.0).abs().max_element();
                assert!(off <= 0.02, "{scattering}/m, {anisotropy}, {p}: {radiance}");
            }
        }
    }
}

/// Each of two fluids side by side looks as it does alone, and equal fluids as one.
#[test]
fn fluids_keep_their_scattering() {
    let Some(mut harness) = harness() else { return };
    let media = [
        Medium {
            absorption: Vec3::new(0.2, 0.5, 1.0),
            scattering: Vec3::splat(3.0),
            anisotropy: 0.5,
        },
        Medium {
            absorption: Vec3::new(1.0, 0.5, 0.1),
            scattering: Vec3::splat(9.0),
            anisotropy: 0.5,
        },
    ];
    let body = |fluids: [u32; 2]| -> Splats {
        let mut bodies = [-1.0, 1.0].map(|x| sphere(Vec3::new(x, 0.0, 0.0), 0.6));
        (bodies[0].tags, bodies[1].tags) = (fluids[0], fluids[1]);
        splats(&bodies, &[], 0.05)
    };
    let mut both = turbid(Vec3::ZERO, Vec3::ZERO, 0.0);
    both.environment = Environment::Constant(Vec3::ONE);
    both.fluids = media.to_vec();
    let size = UVec2::new(96, 64);
    let mixed = harness.render(&both, &on_axis(4.0, 45.0), &body([0, 1]), size);
    for (fluid, medium) in media.iter().enumerate() {
        let alone = Scene { liquid: both.liquid.with(*medium), fluids: Vec::new(), ..both.clone() };
        let alone = harness.render(&alone, &on_axis(4.0, 45.0), &body([0, 0]), size);
        let own = |p: &UVec2| (p.x >= 48) == (fluid == 1);
        for p in mixed.pixels().filter(own) {
            let off = (mixed.radiance(p) - alone.radiance(p)).abs().max_element();
            assert!(off < 0.05, "fluid {fluid}, {p}: {off}");
        }
    }
}
