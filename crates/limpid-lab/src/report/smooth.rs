//! Measurement of smoothing filters: the smoothed surface against the true one.

use glam::DVec3;

use super::picture::{Effort, draw};
use super::rows::{ErrorKind, Row, RowKind};
use super::subjects::{Subject, size};
use crate::compare::{PIXELS_PER_DEGREE, flip};
use crate::reference::layers::ViewSpace;
use crate::reference::trace::{MAX_DEPTH, first_last, trace};
use limpid::gpu::Gpu;
use limpid::passes::Layers;
use limpid::renderer::Renderer;
use limpid::settings::{Filter, Settings, Smooth, Unit};
use limpid_io::error::Result;

/// The filters with the default window, and with the papers' window of 9 × 9 pixels.
fn methods(quick: bool) -> Vec<(&'static str, String, Smooth)> {
    let filters = [
        ("plane-fit", Filter::PlaneFit),
        ("bilateral", Filter::Bilateral),
        ("narrow-range", Filter::NarrowRange),
    ];
    let mut methods = vec![("none", String::new(), Smooth { iterations: 0, ..Smooth::default() })];
    for (name, filter) in filters {
        methods.push((name, String::new(), Smooth { filter, ..Smooth::default() }));
        let iterations: &[u32] = if quick { &[5] } else { &[1, 2, 5] };
        for &iterations in iterations {
            let smooth = Smooth {
                filter,
                iterations,
                window: 9.0,
                unit: Unit::Pixel,
                taps: 9,
                sigma: 5.3,
                ..Smooth::default()
            };
            methods.push((name, format!("9×9 px, iterations={iterations}"), smooth));
        }
        if !quick {
            for (window, iterations) in [(2.0, 5), (4.0, 5), (3.0, 3)] {
                let smooth = Smooth { filter, window, iterations, ..Smooth::default() };
                methods.push((name, format!("{window} r, iterations={iterations}"), smooth));
            }
        }
    }
    methods
}

/// Measures all filters on one scene: time, depth and normal errors of the front layer, and FLIP.
///
/// # Errors
/// As [`Renderer::render`].
pub fn measure(
    gpu: &Gpu,
    renderer: &mut Renderer,
    subject: &Subject,
    effort: &Effort,
) -> Result<Vec<Row>> {
    let size = size(subject.name, effort.width);
    let camera = subject.views[0].1;
    let view = ViewSpace::new(&camera.uniform(size, DVec3::ZERO));
    let [front, _] = first_last(&*subject.liquid, &camera, size);
    // Tracing waves is too slow for a picture that other scenes provide too.
    let truth = (!subject.is_water).then(|| {
        let (liquid, samples) = (&*subject.liquid, effort.truth_samples);
        trace(liquid, &subject.scene, &camera, size, samples, MAX_DEPTH).to_srgb()
    });
    let mut rows = Vec::new();
    for (method, settings_text, smooth) in methods(!effort.variants) {
        let settings = Settings { smooth, ..Settings::default() };
        let (scene, loaded) = subject.with(&settings)?;
        let (picture, times) =
            draw(gpu, renderer, loaded.picture(&scene, &camera, size), effort.repeats)?;
        let of_smooth: Vec<f64> = times
            .iter()
            .map(|passes| passes.iter().filter(|p| p.name == "smooth").map(|p| p.ms).sum())
            .collect();
        let texels = gpu.read_texture(&renderer.images().smoothed.texture, Layers::FRONT)?;
        let texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&texels);
        let errors = surface_errors(&view, &texels, &front.depths, &front.normals);
        let radius = f64::from(loaded.splats.radius);
        let row = || {
            let mut row = Row::new(RowKind::Smooth, subject.name, method, &settings_text);
            row.iterations = Some(settings.smooth.iterations.into());
            row.timed(&of_smooth)
        };
        if let Some(SurfaceErrors { angles: [median, p90], depths: [all, nine_tenths] }) = errors {
            let errors = [
                (median, ErrorKind::NormalMedianDegrees),
                (p90, ErrorKind::NormalP90Degrees),
                (all / radius, ErrorKind::DepthRmsAllRadii),
                (nine_tenths / radius, ErrorKind::DepthRmsNineTenthsRadii),
            ];
            rows.extend(errors.map(|(error, kind)| row().with_error(error, kind, subject.truth)));
        }
        if let Some(truth) = &truth {
            let map = flip(truth, &picture, PIXELS_PER_DEGREE)?;
            rows.push(row().with_error(map.mean(), ErrorKind::MeanFlip, subject.truth));
        }
    }
    Ok(rows)
}

/// Errors of a surface at the pixels that both surfaces cover.
#[derive(Debug, Clone, Copy, PartialEq)]
struct SurfaceErrors {
    /// Median and 90th percentile of the angle between normals, degrees.
    angles: [f64; 2],
    /// Root mean square difference of depths, m: over all pixels, and without the tenth with the
    /// largest differences.
    depths: [f64; 2],
}

/// Compares a layer's texels with true depths and normals; `None` if no pixel has both.
fn surface_errors(
    view: &ViewSpace,
    texels: &[[f32; 4]],
    depths: &[f64],
    normals: &[DVec3],
) -> Option<SurfaceErrors> {
    let width = view.size.x as usize;
    let mut angles = Vec::new();
    let mut differences = Vec::new();
    for (i, ((texel, &depth), &normal)) in texels.iter().zip(depths).zip(normals).enumerate() {
        let plane = DVec3::new(texel[0].into(), texel[1].into(), texel[2].into());
        let pixel = glam::DVec2::new((i % width) as f64, (i / width) as f64) + 0.5;
        let disparity = plane.dot(view.omega(pixel));
        if depth > 0.0 && disparity > 0.0 && normal != DVec3::ZERO {
            // π points away from the eye, a front's normal towards the eye.
            angles.push((-plane.normalize()).dot(normal).clamp(-1.0, 1.0).acos().to_degrees());
            differences.push((1.0 / disparity - depth).abs());
        }
    }
    if angles.is_empty() {
        return None;
    }
    angles.sort_by(f64::total_cmp);
    differences.sort_by(f64::total_cmp);
    let at = |share: f64| angles[((angles.len() - 1) as f64 * share) as usize];
    let rms = |differences: &[f64]| {
        (differences.iter().map(|d| d * d).sum::<f64>() / differences.len() as f64).sqrt()
    };
    let nine_tenths = (differences.len() * 9).div_ceil(10);
    Some(SurfaceErrors {
        angles: [at(0.5), at(0.9)],
        depths: [rms(&differences), rms(&differences[..nine_tenths])],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The true planes have no error; planes tilted and shifted by known amounts have these errors.
    #[test]
    fn errors_of_known_planes() {
        let view = ViewSpace {
            size: glam::DVec2::new(16.0, 12.0),
            tangent: glam::DVec2::new(0.4, 0.3),
            near: 1e-3,
            far: None,
        };
        let (depth, tilt) = (5.0, 0.1f64);
        let surface = |angle: f64, z: f64| {
            // The plane through (0, 0, −z) whose normal towards the eye is tilted about x.
            let normal = DVec3::new(0.0, angle.sin(), angle.cos());
            let plane = normal / normal.dot(DVec3::new(0.0, 0.0, -z));
            (normal, plane)
        };
        let pixels = (0..16 * 12).map(|i| glam::DVec2::new((i % 16) as f64, (i / 16) as f64) + 0.5);
        let (normal, plane) = surface(0.0, depth);
        let depths: Vec<f64> = pixels.map(|u| 1.0 / plane.dot(view.omega(u))).collect();
        let normals = vec![normal; depths.len()];
        let texels = |plane: DVec3| {
            let p = plane.as_vec3();
            vec![[p.x, p.y, p.z, 1.0]; depths.len()]
        };
        let same = surface_errors(&view, &texels(plane), &depths, &normals).expect("a surface");
        let all = same.angles.iter().chain(&same.depths);
        assert!(all.copied().all(|e| e < 1e-3), "{same:?}");
        let (_, tilted) = surface(tilt, depth);
        let found = surface_errors(&view, &texels(tilted), &depths, &normals).unwrap();
        let [median, p90] = found.angles;
        assert!((median - tilt.to_degrees()).abs() < 1e-3, "{median}");
        assert!((p90 - tilt.to_degrees()).abs() < 1e-3, "{p90}");
        let (_, shifted) = surface(0.0, depth + 0.25);
        let found = surface_errors(&view, &texels(shifted), &depths, &normals).unwrap();
        for rms in found.depths {
            assert!((rms - 0.25).abs() < 1e-5, "{rms}");
        }
        // One pixel in twelve far off raises the mean over all pixels, but not that of nine tenths.
        let (_, far) = surface(0.0, 4.0 * depth);
        let mut with_outliers = texels(plane);
        with_outliers[..16].copy_from_slice(&texels(far)[..16]);
        let found = surface_errors(&view, &with_outliers, &depths, &normals).unwrap();
        assert!((found.depths[0] - 3.0 * depth / 12f64.sqrt()).abs() < 1e-3, "{found:?}");
        assert!(found.depths[1] < 1e-3, "{found:?}");
        assert_eq!(surface_errors(&view, &vec![[0.0; 4]; 192], &depths, &normals), None);
    }
}
