//! Caustic maps on the device, against closed forms and against light traced in f64.

use std::path::Path;

use glam::{DVec2, DVec3, UVec2};
use limpid::light_view::LightView;
use limpid::scene::{Light, Scene};
use limpid::settings::Method;
use limpid_io::project::Project;
use limpid_lab::reference::analytic::{Block, Pool};
use limpid_lab::reference::surroundings::Surroundings;
use limpid_lab::reference::{Liquid, Ray, optics};
use limpid_lab::report::caustics::{Bench, Run, received, relative_l1};
use limpid_lab::report::intersect::ViewLayers;
use limpid_sim::waves::{WaveSpectrum, Waves};

use crate::support::gpu;

const IOR: f64 = 1.33;

/// The particle radius that settings are multiples of; the layers here have none.
const RADIUS: f32 = 1e-3;

/// A scene with a sun of irradiance 2 along `direction`.
fn scene(direction: DVec3, absorption: f64, solids: &str) -> Scene {
    let [x, y, z] = direction.to_array();
    let text = format!(
        "[liquid]\nior = {IOR:?}\nabsorption = [{absorption:?}, 0.0, 0.0]\n{solids}\n\
         [[light]]\nsun = {{ direction = [{x:?}, {y:?}, {z:?}], irradiance = [2.0, 2.0, 2.0] }}\n"
    );
    Project::parse(&text, "caustics", Path::new(".")).expect("a valid scene").scene
}

fn floor(depth: f64) -> String {
    format!(
        "[[solid]]\nshape = \"plane\"\norigin = [0.0, {:?}, 0.0]\nlit = true\ncolor = [1.0, 1.0, 1.0]\n",
        -depth
    )
}

fn flat(half: f64) -> Pool {
    Pool {
        waves: Waves::default(),
        min: DVec2::splat(-half),
        max: DVec2::splat(half),
        bottom: f64::NEG_INFINITY,
    }
}

/// The light's view of everything within `half` of the origin, from `depth` below y = 0 up to 0.
fn view(scene: &Scene, half: f64, depth: f64, resolution: u32, level: bool) -> LightView {
    let bounds = (DVec3::new(-half, -depth, -half), DVec3::new(half, 0.0, half));
    let level = level.then_some((0.0, IOR));
    LightView::new(&scene.lights[0], bounds, &scene.solids, 0.0, resolution, level)
        .expect("a light that sees the liquid")
}

fn run(scene: &Scene, view: &LightView, liquid: &dyn Liquid) -> Option<Run> {
    let gpu = gpu()?;
    let layers = ViewLayers::of_light(liquid, scene, view);
    let mut bench = Bench::new(gpu, scene, view, &layers).expect("the layers are uploaded");
    Some(bench.run(scene, 0, RADIUS).expect("the map is made"))
}

fn centers(size: UVec2) -> impl Iterator<Item = DVec2> {
    let pixels = (0..size.y).flat_map(move |y| (0..size.x).map(move |x| UVec2::new(x, y)));
    pixels.map(|p| p.as_dvec2() + 0.5)
}

/// Transmittance of unpolarised light that enters water at an angle of the given cosine.
fn transmitted(cos_theta_i: f64) -> f64 {
    let d = DVec3::new((1.0 - cos_theta_i * cos_theta_i).sqrt(), -cos_theta_i, 0.0);
    1.0 - optics::Interface::new(d, DVec3::Y, IOR).reflectance
}

/// Asserts that the map equals `expected` (for an irradiance of 2) in its middle, `border` texels
/// from its edges.
fn assert_even(run: &Run, view: &LightView, expected: DVec3, tolerance: f64, border: f64) {
    let size = view.size.as_dvec2();
    let mut seen = 0;
    for (u, e) in centers(view.size).zip(&run.irradiance) {
        if u.cmpgt(DVec2::splat(border)).all() && u.cmplt(size - border).all() {
            for (got, expected) in e.iter().zip((2.0 * expected).to_array()) {
                let error = f64::from(*got) / expected - 1.0;
                assert!(
                    error.abs() <= tolerance,
                    "{error} at {u} of {size}: {got}, not {expected}"
                );
            }
            seen += 1;
        }
    }
    assert!(seen > 1000, "{seen} texels");
}

/// Radiometry under still water, with the sun overhead or slanting, on the floor and with
/// absorption: every texel receives E T cos(theta) exp(-sigma l). Checks that the incident vector
/// is normalized, that the cosine is applied once, and that a cell's light is neither lost nor
/// doubled between texels.
#[test]
fn still_water_gives_uniform_irradiance() {
    for (direction, sigma) in
        [(DVec3::NEG_Y, 0.0), (DVec3::new(-0.5, -1.0, 0.5), 0.0), (DVec3::new(0.9, -1.0, 0.2), 0.3)]
    {
        let towards = -direction.normalize();
        let mut scene = scene(direction, sigma, &floor(2.0));
        for (grid, interfaces) in [(128, 1), (128, 2), (50, 2), (300, 1)] {
            scene.settings.caustics.grid = grid;
            scene.settings.caustics.interfaces = interfaces;
            let view = view(&scene, 4.0, 2.0, 128, true);
            let Some(run) = run(&scene, &view, &flat(30.0)) else { return };
            let cos_theta_t = (1.0 - (1.0 - towards.y * towards.y) / (IOR * IOR)).sqrt();
            let even = transmitted(towards.y) * towards.y;
            let red = even * (-sigma * 2.0 / cos_theta_t).exp();
            assert_even(&run, &view, DVec3::new(red, even, even), 1e-3, 8.0);
        }
    }
}

/// Snell's law for a light direction that is not a unit vector: a sun 35.264° from the vertical is
/// refracted to 25.728°, along which the map's view looks.
#[test]
fn slanting_sun_obeys_snell() {
    let scene = scene(DVec3::new(-0.5, -1.0, 0.5), 0.0, &floor(2.0));
    let view = view(&scene, 4.0, 2.0, 64, true);
    let angle = (-view.ray(DVec2::ZERO).1.y).acos().to_degrees();
    assert!((angle - 25.728).abs() < 1e-3, "{angle}");
}

/// Vertical receivers: a wall under water receives the same light per perpendicular area as the
/// floor.
#[test]
fn walls_receive_light_by_their_cosine() {
    let wall = "[[solid]]\nshape = \"box\"\nmin = [-30.0, -9.0, -30.0]\nmax = [-2.0, 1.0, 30.0]\nlit = true\n";
    let direction = DVec3::new(-1.0, -1.0, 0.0);
    let scene = scene(direction, 0.0, &(floor(6.0) + wall));
    let view = view(&scene, 4.0, 6.0, 256, true);
    let Some(run) = run(&scene, &view, &flat(30.0)) else { return };
    let cos_theta_i = 0.5f64.sqrt();
    let sin_theta_t = cos_theta_i / IOR;
    let cos_theta_t = (1.0 - sin_theta_t * sin_theta_t).sqrt();
    let beam = 2.0 * transmitted(cos_theta_i) * cos_theta_i / cos_theta_t;
    let mut seen = [0, 0];
    for ((u, e), depth) in centers(view.size).zip(&run.irradiance).zip(&run.depths) {
        let (o, d) = view.ray(u);
        let x = o + f64::from(*depth) * d;
        let deep = x.y < -0.5 && x.y > -5.5 && x.x < -1.9;
        let on_floor = x.y < -5.9 && x.x > -1.5 && x.x < 2.0 && x.z.abs() < 3.0;
        let expected = if deep { beam * sin_theta_t } else { beam * cos_theta_t };
        if x.z.abs() < 3.0 && (deep || on_floor) {
            let error = f64::from(e[1]) / expected - 1.0;
            assert!(error.abs() < 2e-3, "{error} at {x}");
            seen[usize::from(deep)] += 1;
        }
    }
    assert!(seen.iter().all(|&n| n > 1000), "{seen:?}");
}

/// The second interface: light through a plate is attenuated by both faces and by the absorption in
/// between, by every method that traces it that far.
#[test]
fn light_passes_through_a_plate() {
    let plate = Block { min: DVec3::new(-30.0, -0.5, -30.0), max: DVec3::new(30.0, 0.0, 30.0) };
    for direction in [DVec3::NEG_Y, DVec3::new(0.4, -1.0, 0.3)] {
        let mut scene = scene(direction, 0.7, &floor(2.0));
        for method in [Method::Forward, Method::Straight] {
            scene.settings.caustics.method = method;
            let view = view(&scene, 4.0, 2.0, 128, false);
            let Some(run) = run(&scene, &view, &plate) else { return };
            let cos_theta_i = -direction.normalize().y;
            let cos_theta_t = (1.0 - (1.0 - cos_theta_i * cos_theta_i) / (IOR * IOR)).sqrt();
            let length = 0.5 / if method == Method::Straight { cos_theta_i } else { cos_theta_t };
            let even = transmitted(cos_theta_i).powi(2) * cos_theta_i;
            let expected = even * DVec3::new((-0.7 * length).exp(), 1.0, 1.0);
            assert_even(&run, &view, expected, 1e-3, 20.0);
        }
    }
}

/// Areas through and beyond a focus: a flat surface whose normals refract light to x (1 - d/F) at
/// depth d concentrates it by 1/(1 - d/F)², to 2 %, before the focus and behind it, where every
/// cell is flipped.
#[test]
fn a_linear_lens_focuses_by_its_square() {
    const F: f64 = 20.0;
    for share in [0.3, 0.6, 0.8, 1.25, 1.6, 2.0] {
        let depth = share * F;
        let scene = scene(DVec3::NEG_Y, 0.0, &floor(depth));
        let view = view(&scene, 1.0, depth, 256, false);
        let lens = |u: DVec2| {
            let (o, d) = view.ray(u);
            let x = o - d * (o.y / d.y);
            let refracted = DVec3::new(-x.x / F, -1.0, -x.z / F).normalize();
            view.texel(x, (DVec3::NEG_Y - IOR * refracted).normalize())
        };
        let solid = |u: DVec2| {
            let (o, d) = view.ray(u);
            view.texel(o + d * ((-depth - o.y) / d.y), DVec3::Y)
        };
        let nothing = vec![[0.0; 4]; view.size.element_product() as usize];
        let layers = ViewLayers {
            size: view.size,
            aggregate: [centers(view.size).map(lens).collect(), nothing],
            splash: None,
            solids: centers(view.size).map(solid).collect(),
        };
        let Some(gpu) = gpu() else { return };
        let mut bench = Bench::new(gpu, &scene, &view, &layers).expect("the layers are uploaded");
        let run = bench.run(&scene, 0, RADIUS).expect("the map is made");
        // Texels well inside the spot.
        let spot = (1.0 - share).abs().min(1.0) * 128.0;
        let expected = 2.0 * transmitted(1.0) / (1.0 - share).powi(2);
        let mut seen = 0;
        for (u, e) in centers(view.size).zip(&run.irradiance) {
            if u.distance(DVec2::splat(128.0)) < 0.8 * spot {
                let error = f64::from(e[1]) / expected - 1.0;
                assert!(error.abs() < 0.02, "{error} at {u}, {share} of the focal length");
                seen += 1;
            }
        }
        assert!(seen > 1000, "{seen} texels");
    }
}

/// Energy conservation: the bottom of a walled pool receives the light that the waves transmit, to
/// 1 %, with folds of both orientations.
#[test]
fn light_is_conserved_in_a_pool() {
    let walls = [[-40.0, -12.0, -40.0, 40.0], [12.0, 40.0, -40.0, 40.0], [-12.0, 12.0, -40.0, -12.0], [-12.0, 12.0, 12.0, 40.0]]
        .map(|[x0, x1, z0, z1]: [f64; 4]| {
            format!("[[solid]]\nshape = \"box\"\nmin = [{x0:?}, -9.0, {z0:?}]\nmax = [{x1:?}, 0.1, {z1:?}]\nlit = true\n")
        })
        .concat();
    for (seed, slope, direction) in [(1, 0.06, DVec3::NEG_Y), (2, 0.12, DVec3::new(0.3, -1.0, 0.2))]
    {
        let spectrum = WaveSpectrum { count: 20, wavelengths: [1.0, 4.0], rms_slope: slope, seed };
        let waves = Waves::new(&spectrum);
        let pool = Pool { waves: waves.clone(), ..flat(12.0) };
        let mut scene = scene(direction, 0.0, &(floor(2.0) + &walls));
        scene.settings.caustics.grid = 256;
        let view = view(&scene, 12.0, 2.0, 256, true);
        let Some(run) = run(&scene, &view, &pool) else { return };
        let got = received(&view, &run, &scene).y;
        let sent = transmitted_power(&scene, &waves, 12.0);
        let error = got / sent - 1.0;
        assert!(error.abs() < 0.01, "received {got}, sent {sent}: {error}");
    }
}

/// Cells of a coarse grid, which cover hundreds of texels each and are shared out among threads, lay down all of their
/// light: as much as those of a fine grid, to 2 %.
#[test]
fn large_cells_lay_down_their_light() {
    let mut scene = scene(DVec3::NEG_Y, 0.0, &floor(2.0));
    let view = view(&scene, 12.0, 2.0, 256, true);
    let mut light = |grid| {
        scene.settings.caustics.grid = grid;
        run(&scene, &view, &flat(12.0)).map(|run| received(&view, &run, &scene).y)
    };
    let (Some(coarse), Some(fine)) = (light(12), light(256)) else { return };
    assert!((coarse / fine - 1.0).abs() < 0.02, "{coarse} of {fine} W");
}

/// Light that enters waves within `half` of the origin, W, by quadrature over their surface.
fn transmitted_power(scene: &Scene, waves: &Waves, half: f64) -> f64 {
    let Light::Sun { direction, .. } = scene.lights[0] else { panic!("a sun") };
    let towards = -direction.as_dvec3().normalize();
    let surroundings = Surroundings::new(scene);
    let n = 600;
    let side = 2.0 * half / f64::from(n);
    let cell = |i: i32, j: i32| {
        let at = DVec2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) * side - half;
        let slope = waves.slope(at);
        let x = DVec3::new(at.x, waves.height(at), at.y);
        let area = DVec3::new(-slope.x, 1.0, -slope.y);
        let ray = Ray { origin: x, direction: towards };
        if surroundings.hit(&ray).is_some() {
            return 0.0;
        }
        2.0 * transmitted(towards.dot(area.normalize())) * towards.dot(area) * side * side
    };
    (0..n).flat_map(|i| (0..n).map(move |j| cell(i, j))).sum()
}

/// A wide pool with waves, its light, and the true map: light traced in f64.
fn waves_in_a_pool(
    resolution: u32,
) -> (Scene, LightView, Pool, limpid_lab::reference::caustics::CausticMap, f64) {
    use limpid_lab::reference::caustics::{Views, beams_with_error};
    let spectrum = WaveSpectrum { count: 20, wavelengths: [0.8, 3.0], rms_slope: 0.06, seed: 3 };
    let pool = Pool { waves: Waves::new(&spectrum), ..flat(30.0) };
    let scene = scene(DVec3::new(-0.5, -1.0, 0.5), 0.2, &floor(3.0));
    let map = view(&scene, 4.0, 3.0, resolution, true);
    let light = view(&scene, 8.0, 3.0, 2 * resolution, false);
    let views = Views { light: &light, map: &map };
    let (truth, own) = beams_with_error(&pool, &scene, &scene.lights[0], views, 1, 2);
    (scene, map, pool, truth, own)
}

/// Whether a texel is at least a tenth of the map from its edges, which receive light from outside
/// the view.
fn inside(view: &LightView) -> impl Fn(usize) -> bool + use<> {
    let size = view.size;
    move |i| {
        let p = UVec2::new(i as u32 % size.x, i as u32 / size.x);
        p.min(size - 1 - p).cmpgt(size / 10).all()
    }
}

/// The whole of `forward`: over waves, against an independent f64 trace through the analytic
/// surface, its error decreases with the grid's resolution to below 2 %, with as many cells as
/// texels below 3 %.
#[test]
fn forward_converges_to_the_truth() {
    let (mut scene, view, pool, truth, own) = waves_in_a_pool(128);
    assert!(own < 0.02, "{own}");
    let mut errors = Vec::new();
    for grid in [32, 64, 128, 256] {
        scene.settings.caustics.grid = grid;
        scene.settings.caustics.interfaces = 1;
        let Some(run) = run(&scene, &view, &pool) else { return };
        errors.push(relative_l1(&run.irradiance, &truth.irradiance, inside(&view)));
    }
    assert!(errors.is_sorted_by(|a, b| a > b), "{errors:?}");
    assert!(errors[2] < 0.03 && errors[3] < 0.02, "{errors:?}");
}

/// `gather` as the renderer uses it, in a view along refracted light: nearly every texel's walk
/// ends at a path, and the map differs from the truth by less than 5 %.
#[test]
fn gather_agrees_with_the_truth() {
    let (mut scene, view, pool, truth, _) = waves_in_a_pool(128);
    scene.settings.caustics.method = Method::Gather;
    scene.settings.caustics.interfaces = 1;
    for (grid, bound) in [(128, 0.05), (256, 0.05)] {
        scene.settings.caustics.grid = grid;
        let Some(run) = run(&scene, &view, &pool) else { return };
        let counts = inside(&view);
        let error = relative_l1(&run.irradiance, &truth.irradiance, &counts);
        assert!(error < bound, "{error}");
        let states = run.gathered.iter().enumerate().filter(|(i, _)| counts(*i));
        let (mut solved, mut all) = (0, 0);
        for (_, texel) in states {
            all += 1;
            solved += usize::from(texel[3] == 1.0);
        }
        assert!(solved * 100 >= all * 99, "{solved} of {all}");
    }
}
