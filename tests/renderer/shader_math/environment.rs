//! The environments of `scene.wgsl`.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, UVec2, Vec3};
use limpid::environment::{Environment, Glow};
use limpid::passes::scene_binding::SceneUniform;
use limpid::wgpu;

use crate::support::view::{assert_near, case, round3, vec3};
use crate::support::{Kernel, Random, gpu, texture, uniform};

/// The environment map has -z at its centre, +x to the right of it and +y at the top, and wraps without a
/// seam; lookups are exact at texel centres and bilinear between them.
#[test]
fn environment_map_directions() {
    let Some(gpu) = gpu() else { return };
    let size = UVec2::new(16, 8);
    let mut random = Random(15);
    let texels: Vec<[f32; 4]> =
        (0..size.element_product()).map(|_| [(); 4].map(|()| random.unit() as f32)).collect();
    let map = texture(gpu, size, &[&texels]);
    let kernel = Kernel {
        imports: &["common/scene.wgsl"],
        body: "fn test(x: array<f32, 3>) -> array<f32, 3> {
            let c = environment_lookup(vec3f(x[0], x[1], x[2]));
            return array(c.x, c.y, c.z);
        }",
        constants: &[],
        resources: &[(2, 3, wgpu::BindingResource::TextureView(&map))],
    };
    let texel = |x: i64, y: i64| {
        let (w, h) = (i64::from(size.x), i64::from(size.y));
        vec3(&texels[(y.clamp(0, h - 1) * w + x.rem_euclid(w)) as usize][..3])
    };
    // Direction of a map position in texels.
    let shown = |u: f64, v: f64| {
        let (turn, tilt) = ((u / 16.0 - 0.5) * TAU, (0.5 - v / 8.0) * PI);
        DVec3::new(tilt.cos() * turn.sin(), tilt.sin(), -tilt.cos() * turn.cos())
    };
    let mut cases = vec![DVec3::NEG_Z, DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y];
    let mean = |list: &[(i64, i64)]| {
        list.iter().map(|&(x, y)| texel(x, y)).sum::<DVec3>() / list.len() as f64
    };
    let mut expected = vec![
        mean(&[(7, 3), (8, 3), (7, 4), (8, 4)]),
        mean(&[(11, 3), (12, 3), (11, 4), (12, 4)]),
        mean(&[(3, 3), (4, 3), (3, 4), (4, 4)]),
    ];
    let poles = expected.len();
    // The longitude of a pole is undefined, but its row is known.
    expected.extend([DVec3::ZERO; 2]);
    for _ in 0..5000 {
        // Includes the seam; rows beyond the first and last centres repeat them.
        let (u, v) = (random.range(-1.0, 17.0), random.range(0.01, 7.99));
        let (x, y) = ((u - 0.5).floor(), (v - 0.5).floor());
        let (fx, fy) = (u - 0.5 - x, v - 0.5 - y);
        let (i, j) = (x as i64, y as i64);
        let row = |j: i64| texel(i, j) * (1.0 - fx) + texel(i + 1, j) * fx;
        cases.push(shown(u, v));
        expected.push(row(j) * (1.0 - fy) + row(j + 1) * fy);
    }
    let cases: Vec<[f32; 3]> = cases.iter().map(|d| case(&[&d.to_array()])).collect();
    let results: Vec<[f32; 3]> = kernel.run(gpu, &cases);
    for (k, (result, expected)) in results.iter().zip(&expected).enumerate() {
        let got = vec3(result);
        if (poles..poles + 2).contains(&k) {
            let row = if k == poles { 0 } else { 7 };
            let dark = (0..16).map(|x| texel(x, row)).reduce(DVec3::min).expect("texels");
            let bright = (0..16).map(|x| texel(x, row)).reduce(DVec3::max).expect("texels");
            assert!(
                got.cmpge(dark - 1e-6).all() && got.cmple(bright + 1e-6).all(),
                "a pole: {got}"
            );
            continue;
        }
        // WGSL allows angles an error of 4096 units in the last place, 1e-3 of a radian: 2e-3 of a
        // texel here. Towards the poles, rounding of the direction affects the longitude as well.
        let direction = vec3(&cases[k]);
        let tolerance = 6e-3 + 1e-5 / direction.x.hypot(direction.z);
        assert_near(got.distance(*expected), 0.0, tolerance, &format!("towards {direction}"));
    }
}

/// The constant `ENVIRONMENT` selects among the three environments, and constant and gradient match their
/// formulas.
#[test]
fn environment_constant_and_gradient() {
    let Some(gpu) = gpu() else { return };
    let (zenith, horizon, nadir) = ([1.0, 2.0, 3.0], [0.5, 0.25, 0.125], [8.0, 4.0, 2.0]);
    let scene = SceneUniform { zenith, horizon, nadir, ..bytemuck::Zeroable::zeroed() };
    let buffer = uniform(gpu, &scene);
    let map = texture(gpu, UVec2::ONE, &[&[[7.0; 4]]]);
    let mut random = Random(16);
    let cases: Vec<[f32; 3]> = (0..500).map(|_| case(&[&random.direction().to_array()])).collect();
    for kind in 0..3 {
        let kernel = Kernel {
            imports: &["common/scene.wgsl"],
            body: "fn test(x: array<f32, 3>) -> array<f32, 3> {
                let c = environment_radiance(vec3f(x[0], x[1], x[2]));
                return array(c.x, c.y, c.z);
            }",
            constants: &[("ENVIRONMENT", f64::from(kind))],
            resources: &[
                (2, 0, buffer.as_entire_binding()),
                (2, 3, wgpu::BindingResource::TextureView(&map)),
            ],
        };
        let results: Vec<[f32; 3]> = kernel.run(gpu, &cases);
        for (d, result) in cases.iter().zip(results) {
            let y = f64::from(d[1]);
            let end = if y > 0.0 { zenith } else { nadir };
            let expected = match kind {
                0 => vec3(&zenith),
                1 => vec3(&horizon) * (1.0 - y.abs()) + vec3(&end) * y.abs(),
                _ => DVec3::splat(7.0),
            };
            assert_near(vec3(&result).distance(expected), 0.0, 4e-6, "radiance");
        }
    }
}

/// A sky is its gradient and its glows: on the device as by their formulas, and its mean over directions is
/// [`Environment::mean`], the ambient light.
#[test]
fn environment_sky() {
    let Some(gpu) = gpu() else { return };
    let (zenith, horizon, nadir) = ([1.0, 2.0, 3.0], [0.5, 0.25, 0.125], [8.0, 4.0, 2.0]);
    let mut random = Random(17);
    let mut glow = |sharpness| Glow {
        direction: random.direction().as_vec3().normalize(),
        radiance: Vec3::new(5.0, 3.0, 1.0),
        sharpness,
    };
    let glows = [glow(40.0), glow(3.0)];
    let scene = SceneUniform {
        zenith,
        horizon,
        nadir,
        glow_lobes: glows.map(|glow| glow.direction.extend(glow.sharpness).to_array()),
        glow_radiances: glows.map(|glow| glow.radiance.extend(0.0).to_array()),
        ..bytemuck::Zeroable::zeroed()
    };
    let buffer = uniform(gpu, &scene);
    let map = texture(gpu, UVec2::ONE, &[&[[7.0; 4]]]);
    let kernel = Kernel {
        imports: &["common/scene.wgsl"],
        body: "fn test(x: array<f32, 3>) -> array<f32, 3> {
            let c = environment_radiance(vec3f(x[0], x[1], x[2]));
            return array(c.x, c.y, c.z);
        }",
        constants: &[("ENVIRONMENT", 3.0)],
        resources: &[
            (2, 0, buffer.as_entire_binding()),
            (2, 3, wgpu::BindingResource::TextureView(&map)),
        ],
    };
    // Evenly distributed over the sphere (a Fibonacci lattice).
    let count = 20_000;
    let directions: Vec<DVec3> = (0..count)
        .map(|i| {
            let y = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
            let (sin, cos) = (f64::from(i) * PI * (3.0 - 5f64.sqrt())).sin_cos();
            round3((1.0 - y * y).sqrt() * DVec3::new(cos, 0.0, sin) + DVec3::Y * y)
        })
        .collect();
    let cases: Vec<[f32; 3]> = directions.iter().map(|d| case(&[&d.to_array()])).collect();
    let results: Vec<[f32; 3]> = kernel.run(gpu, &cases);
    let mut sum = DVec3::ZERO;
    for (d, result) in directions.iter().zip(&results) {
        let end = if d.y > 0.0 { zenith } else { nadir };
        let rise = 1.0 - (1.0 - d.y.abs()).powi(2);
        let gradient = vec3(&horizon).lerp(vec3(&end), rise);
        let expected = glows.iter().fold(gradient, |sum, glow| {
            let cosine = glow.direction.as_dvec3().dot(*d);
            sum + glow.radiance.as_dvec3() * (f64::from(glow.sharpness) * (cosine - 1.0)).exp()
        });
        assert_near(vec3(result).distance(expected), 0.0, 2e-5, "radiance");
        sum += expected / f64::from(count);
    }
    let [zenith, horizon, nadir] = [zenith, horizon, nadir].map(Vec3::from_array);
    let sky = Environment::Sky { zenith, horizon, nadir, glows };
    assert_near(sky.mean().as_dvec3().distance(sum), 0.0, 1e-3, "mean");
    // A sharp lobe has the mean of its closed form too.
    let sun = Glow { direction: Vec3::Y, radiance: Vec3::ONE, sharpness: 1e4 };
    let [zenith, horizon, nadir] = [Vec3::ZERO; 3];
    let sky = Environment::Sky { zenith, horizon, nadir, glows: [sun, Glow::NONE] };
    assert_near(f64::from(sky.mean().x), 0.5e-4, 1e-9, "the mean of a sharp lobe");
}

/// A glow in a curved surface is averaged over the rays of a pixel. Without a spread it is the glow itself; with one along x
/// its integral over d is the same; and the pixels in a row across a glow that is a sixth of a pixel wide add up to the
/// same light, to a tenth, wherever the row begins, where single rays see up to all of it or none.
#[test]
fn glows_are_averaged_over_a_pixel() {
    let Some(gpu) = gpu() else { return };
    let sharpness = 900.0;
    let lobe = DVec3::new(0.36, 0.48, 0.8);
    let across = DVec3::new(0.8, -0.6, 0.0);
    let along = lobe.cross(across);
    let scene = SceneUniform {
        glow_lobes: [lobe.extend(sharpness).as_vec4().to_array(), [0.0, 1.0, 0.0, 1.0]],
        glow_radiances: [[1.0, 2.0, 3.0, 0.0], [0.0; 4]],
        ..bytemuck::Zeroable::zeroed()
    };
    let (buffer, map) = (uniform(gpu, &scene), texture(gpu, UVec2::ONE, &[&[[0.0; 4]]]));
    let kernel = Kernel {
        imports: &["common/scene.wgsl"],
        body: "fn test(x: array<f32, 9>) -> array<f32, 3> {
            let spread = Spread(vec3f(x[3], x[4], x[5]), vec3f(x[6], x[7], x[8]));
            let c = environment_over(vec3f(x[0], x[1], x[2]), spread);
            return array(c.x, c.y, c.z);
        }",
        constants: &[("ENVIRONMENT", 3.0)],
        resources: &[
            (2, 0, buffer.as_entire_binding()),
            (2, 3, wgpu::BindingResource::TextureView(&map)),
        ],
    };
    let seen = |d: DVec3, x: DVec3, y: DVec3| {
        case::<9>(&[&d.normalize().to_array(), &x.to_array(), &y.to_array()])
    };
    // Standard deviation of the glow, radians.
    let sigma = 1.0 / sharpness.sqrt();

    let mut random = Random(18);
    let near: Vec<_> = (0..200).map(|_| lobe + 0.1 * random.direction()).collect();
    let cases: Vec<_> = near.iter().map(|&d| seen(d, DVec3::ZERO, DVec3::ZERO)).collect();
    for (d, result) in near.iter().zip(kernel.run::<9, 3>(gpu, &cases)) {
        let plain = (sharpness * (lobe.dot(d.normalize()) - 1.0)).exp();
        let expected = plain * DVec3::new(1.0, 2.0, 3.0);
        assert_near(vec3(&result).distance(expected), 0.0, 1e-3, "without a spread");
    }

    for spread in [2.0, 6.0].map(|widths| widths * sigma) {
        for (x, y) in [(spread * across, 0.5 * spread * along), (spread * along, DVec3::ZERO)] {
            let step = 0.25 * sigma;
            let at = |i: i32| step * f64::from(i);
            let places = (-160..=160).flat_map(|i| (-160..=160).map(move |j| (at(i), at(j))));
            let cases: Vec<_> =
                places.map(|(u, v)| seen(lobe + u * across + v * along, x, y)).collect();
            let sum: f64 = kernel.run::<9, 3>(gpu, &cases).iter().map(|c| f64::from(c[0])).sum();
            let expected = TAU * sigma * sigma;
            assert_near(sum * step * step / expected, 1.0, 0.05, "the light of a glow");
        }
    }

    let spread = 6.0 * sigma;
    let row = |phase: f64| {
        let at = |i: i32| lobe + (f64::from(i) + phase) * spread * across;
        let cases: Vec<_> = (-6..=6).map(|i| seen(at(i), spread * across, DVec3::ZERO)).collect();
        kernel.run::<9, 3>(gpu, &cases).iter().map(|c| f64::from(c[0])).sum::<f64>()
    };
    let expected = TAU.sqrt() * sigma / spread;
    for phase in [0.0, 0.2, 0.35, 0.5] {
        assert_near(row(phase) / expected, 1.0, 0.1, &format!("a row that begins at {phase}"));
    }
}
