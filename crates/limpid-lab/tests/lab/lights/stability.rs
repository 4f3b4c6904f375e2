//! Lit pictures from frame to frame.

use glam::{DVec2, DVec3, UVec2, Vec3};
use limpid::light_view::LightView;
use limpid::scene::Shape;
use limpid_lab::reference::analytic::Pool;
use limpid_lab::reference::caustics::{Views, beams};
use limpid_lab::report::caustics::{Bench, relative_l1};
use limpid_lab::report::intersect::ViewLayers;
use limpid_sim::waves::{WaveSpectrum, Waves};

use super::{IOR, dry, lit, sun};
use crate::support::frames::gpu;

// stability

/// Temporal stability: over 24 frames of a moving pool, with exact layers in one view of the light,
/// the map changes from frame to frame by as much as the true one, to 10 %. A flickering map
/// changes more, a lagging or smeared one less.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn caustics_change_as_the_truth_does() {
    let Some(gpu) = gpu() else { return };
    let spectrum = WaveSpectrum { count: 6, wavelengths: [1.0, 3.0], rms_slope: 0.05, seed: 7 };
    let waves = Waves::new(&spectrum);
    let bottom = DVec3::new(0.0, -2.0, 0.0);
    let shape = Shape::Plane { origin: bottom, normal: Vec3::Y, half_extent: f32::INFINITY };
    let mut scene = dry(&[lit(shape)], &[sun(Vec3::new(-0.4, -1.0, 0.3))]);
    scene.settings.caustics.interfaces = 1;
    scene.settings.caustics.grid = 192;
    let (light, resolution) = (&scene.lights[0], 96);
    let bounds = |half: f64| (DVec3::new(-half, -2.0, -half), DVec3::new(half, 0.0, half));
    let level = Some((0.0, IOR));
    let view = LightView::new(light, bounds(3.0), &scene.solids, 0.0, resolution, level);
    let view = view.expect("a light that sees the pool");
    let source = LightView::new(light, bounds(5.0), &scene.solids, 0.0, resolution, None);
    let source = source.expect("a light that sees the pool");
    // The border receives light from outside the view.
    let inner = |i: usize| {
        let p = UVec2::new(i as u32 % view.size.x, i as u32 / view.size.x);
        p.min(view.size - 1 - p).cmpgt(view.size / 8).all()
    };
    let (mut maps, mut truths) = (Vec::new(), Vec::new());
    for frame in 0..24 {
        let waves = waves.at(f64::from(frame) / 30.0);
        let pool = Pool {
            waves,
            min: DVec2::splat(-30.0),
            max: DVec2::splat(30.0),
            bottom: f64::NEG_INFINITY,
        };
        let layers = ViewLayers::of_light(&pool, &scene, &view);
        let mut bench = Bench::new(&gpu, &scene, &view, &layers).expect("layers");
        let run = bench.run(&scene, 0, 1e-3).expect("a map");
        let views = Views { light: &source, map: &view };
        let truth = beams(&pool, &scene, light, views, 1, 3);
        let error = relative_l1(&run.irradiance, &truth.irradiance, inner);
        assert!(error < 0.05, "frame {frame}: {error}");
        let green: Vec<_> = run.irradiance.iter().map(|e| f64::from(e[1])).collect();
        maps.push(green);
        truths.push(truth.irradiance.iter().map(|e| e.y).collect::<Vec<_>>());
    }
    let changes = |frames: &[Vec<f64>]| -> f64 {
        let pairs = frames.windows(2).flat_map(|w| w[0].iter().zip(&w[1]).enumerate());
        pairs.filter(|(i, _)| inner(*i)).map(|(_, (a, b))| (a - b).abs()).sum()
    };
    let (moved, truth) = (changes(&maps), changes(&truths));
    println!("moves by {} of the truth", moved / truth);
    assert!((moved / truth - 1.0).abs() < 0.1, "{moved}, not {truth}");
    // The true maps do change.
    let light: f64 = truths.iter().flatten().sum();
    assert!(truth > 0.01 * light, "{truth} of {light}");
}
