//! `optics.wgsl`: refraction, reflectance and absorption.

use glam::DVec3;
use limpid::gpu::Gpu;

use crate::support::view::{assert_near, case, number, vec3};
use crate::support::{Kernel, Random, gpu};

/// Computes the transmitted cosine, the Fresnel reflectance and Schlick's reflectance on the device.
fn interface(gpu: &Gpu, cases: &[[f32; 2]]) -> Vec<[f32; 3]> {
    let kernel = Kernel {
        imports: &["common/optics.wgsl"],
        body: "fn test(x: array<f32, 2>) -> array<f32, 3> {
            let c = optics_cos_transmitted(x[0], x[1]);
            return array(c, optics_fresnel(x[0], c, x[1]), optics_schlick(x[0], c, x[1]));
        }",
        constants: &[],
        resources: &[],
    };
    kernel.run(gpu, cases)
}

/// Unpolarised reflectance by Fresnel's sine and tangent laws; 1 beyond the critical angle.
fn fresnel(sin2_i: f64, sin2_t: f64, eta: f64) -> f64 {
    if sin2_t >= 1.0 {
        return 1.0;
    }
    if sin2_i < 1e-12 {
        return ((eta - 1.0) / (eta + 1.0)).powi(2);
    }
    let (i, t) = (sin2_i.sqrt().asin(), sin2_t.max(0.0).sqrt().asin());
    let s = (i - t).sin() / (i + t).sin();
    let p = (i - t).tan() / (i + t).tan();
    0.5 * (s * s + p * p)
}

/// Textbook values: Snell's angles, the critical angle between water and air to a ten-thousandth of a
/// degree, Fresnel's and Schlick's reflectances.
#[test]
fn optics_known_angles() {
    let Some(gpu) = gpu() else { return };
    let into = 1.33;
    let out = 1.0 / 1.33;
    let at = |degrees: f64, eta: f64| [degrees.to_radians().cos() as f32, eta as f32];
    let cases = [
        at(30.0, into),
        at(0.0, into),
        at(0.0, out),
        at(45.0, out),
        at(48.7534, out),
        at(48.7536, out),
        at(89.0, out),
        at(90.0, into),
    ];
    let results = interface(gpu, &cases);
    let [cos_t, reflectance, schlick] = [0, 1, 2].map(|i| move |r: [f32; 3]| number(r, i));
    assert_near(cos_t(results[0]).acos().to_degrees(), 22.0824, 5e-5, "refracted angle");
    for normal in &results[1..3] {
        assert_near(cos_t(*normal), 1.0, 1e-7, "cosine at normal incidence");
        // 0.33^2 / 2.33^2, from either side.
        assert_near(reflectance(*normal), 0.020_059, 5e-7, "reflectance at normal incidence");
        assert_near(schlick(*normal), 0.020_059, 5e-7, "Schlick at normal incidence");
    }
    assert_near(reflectance(results[3]), 0.13419, 5e-6, "water to air at 45 degrees");
    assert_near(schlick(results[3]), 0.14285, 5e-6, "Schlick with the transmitted cosine");
    // The critical angle is 48.75347 degrees; a ten-thousandth of a degree is 3e-6 in the squared
    // sine, ten times its rounding error.
    assert!(cos_t(results[4]) >= 0.0 && reflectance(results[4]) < 1.0, "transmits: {results:?}");
    // Grazing incidence: all light is reflected, and the refracted angle is the critical angle.
    assert_near(cos_t(results[7]).acos().to_degrees(), 48.7535, 1e-4, "grazing");
    assert_near(reflectance(results[7]), 1.0, 1e-6, "grazing reflectance");
    for total in &results[5..7] {
        assert!(cos_t(*total) < 0.0, "totally reflected: {total:?}");
        assert_eq!(total[1..], [1.0, 1.0]);
    }
}

/// Snell's and Fresnel's laws hold at all angles and indices, including the critical angle.
#[test]
fn optics_match_closed_forms() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(1);
    let cases: Vec<_> = (0..20_000)
        .map(|i| {
            // A third of the cosines are small (grazing).
            let cosine = if i % 3 == 0 { random.magnitude(1e-9, 1.0) } else { random.unit() };
            let eta = random.range(1.02, 3.0);
            [cosine as f32, if i % 2 == 0 { eta } else { 1.0 / eta } as f32]
        })
        .collect();
    // Rounding of the squared transmitted sine: four operations on numbers of about 1, and the
    // division. Near the critical angle the root amplifies it, so results are compared with the
    // interval that this uncertainty spans.
    const ROUNDING: f64 = 5e-7;
    for (x, result) in cases.iter().zip(interface(gpu, &cases)) {
        let (cos_i, eta) = (f64::from(x[0]), f64::from(x[1]));
        let sin2_i = 1.0 - cos_i * cos_i;
        let sin2_t = sin2_i / (eta * eta);
        let [cos_t, reflectance, schlick] = result.map(f64::from);
        if cos_t < 0.0 {
            assert!(sin2_t > 1.0 - ROUNDING, "{x:?} must transmit");
        } else {
            let low = (1.0 - sin2_t - ROUNDING).max(0.0).sqrt();
            let high = (1.0 - sin2_t + ROUNDING).max(0.0).sqrt();
            assert!((low - 1e-6..=high + 1e-6).contains(&cos_t), "{x:?} gives cosine {cos_t}");
        }
        let near = fresnel(sin2_i, sin2_t - ROUNDING, eta);
        let far = fresnel(sin2_i, sin2_t + ROUNDING, eta);
        let (low, high) = (near.min(far) - 2e-6, near.max(far) + 2e-6);
        assert!((low..=high).contains(&reflectance), "{x:?} reflects {reflectance}, not {near}");
        for share in [reflectance, schlick] {
            assert!((0.0..=1.0).contains(&share), "{x:?}: a reflectance of {share}");
        }
    }
}

/// Helmholtz reciprocity: an interface has the same reflectance from either side of a path.
#[test]
fn optics_are_reciprocal() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(2);
    let cases: Vec<_> = (0..5000)
        .map(|_| [random.range(1e-3, 1.0) as f32, random.range(1.02, 3.0) as f32])
        .collect();
    let there = interface(gpu, &cases);
    let back: Vec<_> = cases.iter().zip(&there).map(|(x, r)| [r[0], 1.0 / x[1]]).collect();
    for ((x, there), back) in cases.iter().zip(&there).zip(interface(gpu, &back)) {
        let cos_i = number(*x, 0);
        // The reverse path has the original angle, up to rounding of its squared cosine.
        assert_near(number(back, 0), cos_i, 1e-6 / cos_i + 1e-6, "cosine of the reverse path");
        // Near grazing, reflectance falls from 1 by at most about 4 eta per cosine.
        let tolerance = 4.0 * number(*x, 1) * 1e-6 / cos_i + 2e-6;
        assert_near(number(back, 1), number(*there, 1), tolerance, "reverse reflectance");
    }
}

/// Grazing rays, for which ratios approach 0/0, yield finite results.
#[test]
fn optics_are_finite_at_grazing() {
    let Some(gpu) = gpu() else { return };
    let cosines = [0.0, 1e-38, 1e-20, 1e-8, 1e-4, 1e-2];
    let cases = |eta: f64| cosines.map(|cosine: f64| [cosine as f32, eta as f32]).to_vec();
    for eta in [1.33, 1.0 / 1.33, 1.001, 3.0] {
        for (x, [cos_t, reflectance, schlick]) in
            cases(eta).into_iter().zip(interface(gpu, &cases(eta)))
        {
            assert!(cos_t.is_finite(), "{x:?} gives cosine {cos_t}");
            let shares = [reflectance, schlick];
            assert!(shares.iter().all(|s| (0.0..=1.0).contains(s)), "{x:?} gives {shares:?}");
        }
        for share in &interface(gpu, &cases(eta))[0][1..] {
            assert_near((*share).into(), 1.0, 2e-7, "total reflectance at 90 degrees");
        }
    }
}

/// An index of exactly 1, which scenes may have, yields finite results and no reflection.
#[test]
fn optics_of_index_one_are_finite() {
    let Some(gpu) = gpu() else { return };
    for cosine in [1.0, 0.5, 1e-2, 0.0] {
        let [cos_t, reflectance, _] = interface(gpu, &[[cosine, 1.0]])[0];
        assert!(cos_t.is_finite() && reflectance.is_finite(), "{cosine}: {cos_t} {reflectance}");
        if cosine > 0.0 {
            assert_near(reflectance.into(), 0.0, 1e-6, "reflectance at index 1");
        }
    }
}

/// Refracted directions are unit vectors in the plane of incidence, on the far side, at Snell's angle,
/// from normal to grazing incidence and up to the critical angle.
#[test]
fn optics_refract_directions() {
    let Some(gpu) = gpu() else { return };
    let kernel = Kernel {
        imports: &["common/optics.wgsl"],
        body: "fn test(x: array<f32, 7>) -> array<f32, 4> {
            let d = vec3f(x[0], x[1], x[2]);
            let n = vec3f(x[3], x[4], x[5]);
            let cos_i = -dot(d, n);
            let cos_t = optics_cos_transmitted(cos_i, x[6]);
            let out = optics_refract(d, n, cos_i, max(cos_t, 0.0), x[6]);
            return array(out.x, out.y, out.z, cos_t);
        }",
        constants: &[],
        resources: &[],
    };
    let mut random = Random(3);
    let mut cases: Vec<[f32; 7]> = (0..10_000)
        .map(|i| {
            let n = random.direction();
            let d = random.direction();
            let d = if d.dot(n) > 0.0 { -d } else { d };
            let eta = random.range(1.02, 3.0);
            case(&[&d.to_array(), &n.to_array(), &[if i % 2 == 0 { eta } else { 1.0 / eta }]])
        })
        .collect();
    let grazing = cases.len();
    cases.push(case(&[&[1.0, 0.0, 0.0], &[0.0, 1.0, 0.0], &[1.33]]));
    let results: Vec<[f32; 4]> = kernel.run(gpu, &cases);
    for (x, result) in cases.iter().zip(&results) {
        let (d, n, eta) = (vec3(&x[..3]), vec3(&x[3..6]), f64::from(x[6]));
        let (out, cos_t) = (vec3(&result[..3]), f64::from(result[3]));
        let cos_i = -d.dot(n);
        let along = d + cos_i * n;
        let sin_t = along.length() / eta;
        if sin_t >= 1.0 - 1e-6 {
            continue; // total reflection: tested above
        }
        assert!(cos_t > 0.0, "{x:?} must transmit");
        let expected =
            (sin_t * along.normalize_or_zero() - (1.0 - sin_t * sin_t).sqrt() * n).normalize();
        // The transmitted cosine is the root of a number accurate to 5e-7; the inputs are unit
        // vectors up to 1e-7.
        let tolerance = 2e-6 + 1e-6 / (1.0 - sin_t * sin_t).sqrt();
        assert_near(out.distance(expected), 0.0, tolerance, "refracted direction");
        assert_near(out.length(), 1.0, 3e-7, "unit vector");
    }
    let down = vec3(&results[grazing][..3]);
    assert_near((-down.y).acos().to_degrees(), 48.7535, 5e-5, "90 degrees, below the normal");
}

/// Transmittance follows the Beer-Lambert law per channel, from a drop to an ocean.
#[test]
fn optics_transmittance_is_exponential() {
    let Some(gpu) = gpu() else { return };
    let kernel = Kernel {
        imports: &["common/optics.wgsl"],
        body: "fn test(x: array<f32, 4>) -> array<f32, 3> {
            let t = optics_transmittance(vec3f(x[0], x[1], x[2]), x[3]);
            return array(t.x, t.y, t.z);
        }",
        constants: &[],
        resources: &[],
    };
    let mut random = Random(4);
    let mut cases: Vec<[f32; 4]> = (0..2000)
        .map(|_| {
            let sigma = DVec3::new(0.0, random.magnitude(1e-3, 1e3), random.unit());
            case(&[&sigma.to_array(), &[random.magnitude(1e-4, 1e4)]])
        })
        .collect();
    // The published chord through a ball of water.
    cases.push([1.0, 0.0, 1e30, 1.85329]);
    let results: Vec<[f32; 3]> = kernel.run(gpu, &cases);
    for (x, result) in cases.iter().zip(&results) {
        for channel in 0..3 {
            let depth = f64::from(x[channel]) * f64::from(x[3]);
            // An absolute rounding error of the exponent is a relative error of the result.
            let tolerance = 1e-6 + 2e-6 * depth * (-depth).exp();
            assert_near(number(*result, channel), (-depth).exp(), tolerance, "transmittance");
        }
    }
    assert_near(results[2000][0].into(), 0.156_721, 1e-6, "through the ball");
    assert_eq!(results[2000][1..], [1.0, 0.0]);
}
