//! Validates every pipeline, bind group and command of all kinds of frames on wgpu's no-op device, which
//! validates everything and executes nothing. No adapter is needed.

use std::sync::{Arc, Mutex};

use glam::{DVec3, UVec2, Vec3};
use limpid::aov::{self, Aov};
use limpid::camera::Camera;
use limpid::diffuse::Diffuse;
use limpid::environment::Environment;
use limpid::frame::{FrameInput, Target};
use limpid::gpu::Gpu;
use limpid::liquid::classify::{Splat, Splats};
use limpid::liquid::{ColorMap, Colors, Particles};
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::scene::{Kind, Light, Liquid, Medium, Scene, Shape, Solid, Surface};
use limpid::settings::{Curve, Filter, Fresnel, Method, Reflections, Solids, Solver, Unit};
use limpid::wgpu;

use crate::support::noop::noop;

/// A no-op device that records its validation errors.
struct Checked {
    gpu: Gpu,
    errors: Arc<Mutex<Vec<String>>>,
}

impl Checked {
    fn new() -> Self {
        Self::with(wgpu::Features::empty())
    }

    fn with(required_features: wgpu::Features) -> Self {
        let (device, queue) =
            noop(&wgpu::DeviceDescriptor { required_features, ..Default::default() });
        let errors = Arc::<Mutex<Vec<String>>>::default();
        let seen = errors.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            seen.lock().expect("no panic holds this lock").push(error.to_string());
        }));
        Self { gpu: Gpu::from_device(device, queue), errors }
    }

    /// Takes the errors since the last call.
    fn errors(&self) -> Vec<String> {
        std::mem::take(&mut *self.errors.lock().expect("no panic holds this lock"))
    }

    /// Renders one frame into a new picture and reads it back.
    fn render(&self, renderer: &mut Renderer, input: FrameInput<'_>) {
        let frame = Picture::new(&self.gpu, input.size).expect("the size is allowed");
        renderer.render(input, &frame).expect("the scene is valid");
        let picture = frame.read(&self.gpu).expect("the device is not lost");
        assert_eq!(UVec2::from(picture.dimensions()), input.size);
    }
}

fn camera() -> Camera {
    Camera {
        eye: DVec3::new(0.0, 1.0, 4.0),
        target: DVec3::ZERO,
        up: Vec3::Y,
        fov_y: 40.0,
        near: None,
        lens: None,
    }
}

fn sphere(x: f32) -> Splat {
    Splat {
        centre: [x, 0.0, 0.0],
        radius: 0.1,
        diagonal: [0.1; 3],
        particle: 0,
        off_diagonal: [0.0; 3],
        tags: 0,
    }
}

fn splats(aggregates: usize, splashes: usize) -> Splats {
    let row = |count: usize| (0..count).map(|i| sphere(i as f32 * 0.1)).collect();
    Splats {
        aggregates: row(aggregates),
        splashes: row(splashes),
        radius: 0.1,
        ..Splats::default()
    }
}

fn scene() -> Scene {
    Scene::default()
}

fn solids() -> Vec<Solid> {
    let shapes = [
        Shape::Plane { origin: DVec3::NEG_Y, normal: Vec3::Y, half_extent: f32::INFINITY },
        Shape::Box { min: DVec3::NEG_ONE, max: DVec3::ONE },
        Shape::Sphere { center: DVec3::X, radius: 0.5 },
    ];
    let surface = Surface::Checker { tile: 0.1, even: Vec3::ONE, odd: Vec3::ZERO };
    shapes.map(|shape| Solid { shape, surface: surface.clone(), lit: true }).to_vec()
}

fn lights() -> Vec<Light> {
    vec![
        Light::Sun { direction: Vec3::NEG_Y, irradiance: Vec3::ONE },
        Light::Point { position: DVec3::Y, intensity: Vec3::ONE },
    ]
}

fn environments() -> [Environment; 3] {
    let [zenith, horizon, nadir] = [Vec3::ONE, Vec3::ZERO, Vec3::X];
    [
        Environment::Constant(Vec3::ONE),
        Environment::Gradient { zenith, horizon, nadir },
        Environment::Map { size: UVec2::new(4, 2), pixels: vec![[1.0; 4]; 8].into() },
    ]
}

/// One renderer draws every combination of scene contents in turn, like a viewer: each change of
/// contents and size gives every pass the resources that it needs.
#[test]
fn every_kind_of_frame_is_valid() {
    let device = Checked::new();
    let mut renderer = Renderer::new(&device.gpu);
    // Not a multiple of the tile size, a multiple, and the smallest.
    let sizes = [UVec2::new(33, 17), UVec2::new(16, 24), UVec2::ONE];
    let mut sizes = sizes.iter().cycle();
    let mut draw = |scene: &Scene, splats: &Splats, diagnose: bool, what: &str| {
        let &size = sizes.next().expect("a cycle has no end");
        let input = FrameInput::new(scene, &camera(), splats, size);
        device.render(&mut renderer, FrameInput { diagnose, ..input });
        if diagnose {
            // Readback needs texture usages that drawing does not.
            aov::read(&device.gpu, &renderer.images(), &Aov::ALL).expect("a valid read");
        }
        assert_eq!(device.errors(), [""; 0], "{what} at {size}");
    };
    for solver in [Solver::Guarded, Solver::March, Solver::Newton] {
        for environment in environments() {
            for (solids, lights) in
                [(vec![], vec![]), (solids(), vec![]), (solids(), lights()), (vec![], lights())]
            {
                for diagnose in [false, true] {
                    for splashes in [0, 3] {
                        let mut scene = Scene {
                            environment: environment.clone(),
                            solids: solids.clone(),
                            lights: lights.clone(),
                            ..scene()
                        };
                        scene.settings.refract.solver = solver;
                        let what = format!(
                            "{solver:?}, {} solids, {} lights, {splashes} splashes, diagnose \
                             {diagnose}, {environment:?}",
                            solids.len(),
                            lights.len(),
                        );
                        draw(&scene, &splats(5, splashes), diagnose, &what);
                    }
                }
            }
        }
    }
}

/// Opaque fluids among others, with every intersector that binds other images.
#[test]
fn opaque_fluids_are_valid() {
    let device = Checked::new();
    let mut renderer = Renderer::new(&device.gpu);
    let particles = Particles::from_positions(vec![Vec3::ZERO; 2]);
    let colors = Colors::given(&particles, 0.1, &splats(2, 0), &[Vec3::X; 2]).ok();
    let mut base = Scene { fluids: vec![Medium::default(); 2], solids: solids(), ..scene() };
    base.solids.iter_mut().for_each(|solid| solid.lit = true);
    for (solver, splashes, lights) in [
        (Solver::Newton, 0, vec![]),
        (Solver::Guarded, 3, lights()),
        (Solver::Plane3, 0, lights()),
        (Solver::March, 3, vec![]),
        (Solver::Single, 0, lights()),
    ] {
        for (diagnose, transparent) in [(true, true), (false, false)] {
            let mut scene = Scene { lights: lights.clone(), ..base.clone() };
            scene.settings.refract.solver = solver;
            scene.settings.refract.transparent = transparent;
            let opaque = Splats { colors: colors.clone(), ..splats(2, splashes) };
            let splats = Splats { opaque: Some(Box::new(opaque)), ..splats(5, splashes) };
            let input = FrameInput::new(&scene, &camera(), &splats, UVec2::new(33, 17));
            device.render(&mut renderer, FrameInput { diagnose, ..input });
            assert_eq!(device.errors(), [""; 0], "{solver:?}, {splashes} splashes");
        }
    }
}

/// Opaque bodies of all kinds, one after the other.
#[test]
fn opaque_bodies_are_valid() {
    let device = Checked::new();
    let mut renderer = Renderer::new(&device.gpu);
    let particles = Particles::from_positions(vec![Vec3::ZERO; 5]);
    let map = ColorMap { colors: vec![Vec3::ZERO, Vec3::ONE], range: [0.0, 1.0] };
    let by_value = Colors::by_value(&particles, 0.1, &splats(5, 0), &[0.5; 5], map);
    let given = Colors::given(&particles, 0.1, &splats(5, 0), &[Vec3::X; 5]);
    for colors in [None, by_value.ok(), given.ok()] {
        for (ior, splashes, lights) in [(1.0, 0, vec![]), (1.5, 3, lights())] {
            for (diagnose, solids) in [(true, solids()), (false, vec![])] {
                let liquid = Liquid { kind: Kind::Opaque, ior, ..Liquid::default() };
                let scene = Scene { liquid, solids, lights: lights.clone(), ..scene() };
                let splats = Splats { colors: colors.clone(), ..splats(5, splashes) };
                let input = FrameInput::new(&scene, &camera(), &splats, UVec2::new(33, 17));
                device.render(&mut renderer, FrameInput { diagnose, ..input });
                if diagnose {
                    aov::read(&device.gpu, &renderer.images(), &Aov::ALL).expect("a valid read");
                }
                assert_eq!(device.errors(), [""; 0], "index {ior}, {splashes} splashes");
            }
        }
    }
}

/// Turbid liquids are valid: one fluid and several, in light and without.
#[test]
fn turbid_liquids_are_valid() {
    let device = Checked::new();
    let mut renderer = Renderer::new(&device.gpu);
    let medium = |scattering| Medium { absorption: Vec3::X, scattering, anisotropy: 0.5 };
    for fluids in [vec![], vec![medium(Vec3::X), medium(Vec3::ONE)]] {
        for (splashes, lights, solids) in [(0, vec![], vec![]), (3, lights(), solids())] {
            let liquid = Liquid::default().with(medium(Vec3::ONE));
            let (fluids, count) = (fluids.clone(), fluids.len());
            let scene = Scene { liquid, fluids, solids, lights, ..scene() };
            let splats = splats(5, splashes);
            let input = FrameInput::new(&scene, &camera(), &splats, UVec2::new(33, 17));
            device.render(&mut renderer, FrameInput { diagnose: splashes > 0, ..input });
            assert_eq!(device.errors(), [""; 0], "{count} fluids, {splashes} splashes");
        }
    }
}

/// Foam, spray, bubbles and dust are valid: beside every kind of liquid, lit and unlit.
#[test]
fn diffuse_particles_are_valid() {
    let device = Checked::new();
    let mut renderer = Renderer::new(&device.gpu);
    let foam = Arc::new(Diffuse::from_positions(vec![Vec3::ZERO, Vec3::X], 0.1));
    let scattering = Medium { absorption: Vec3::X, scattering: Vec3::X, anisotropy: 0.5 };
    let turbid = Liquid::default().with(scattering);
    let opaque = Liquid { kind: Kind::Opaque, ..Liquid::default() };
    for (name, liquid) in [("clear", Liquid::default()), ("turbid", turbid), ("opaque", opaque)] {
        for (splashes, lights, solids) in [(0, vec![], vec![]), (3, lights(), solids())] {
            let mut scene = Scene { liquid, solids, lights, ..scene() };
            scene.settings.refract.samples = 1 + splashes as u32;
            let splats = splats(5, splashes);
            let input = FrameInput::new(&scene, &camera(), &splats, UVec2::new(33, 17));
            let input = FrameInput { diffuse: Some(&foam), diagnose: splashes > 0, ..input };
            device.render(&mut renderer, input);
            assert_eq!(device.errors(), [""; 0], "{name}, {splashes} splashes");
        }
    }
}

/// Each setting that affects compilation or recording is valid, with and without diagnostics.
#[test]
fn every_setting_is_valid() {
    let device = Checked::new();
    let mut renderer = Renderer::new(&device.gpu);
    type Change = (&'static str, fn(&mut Scene));
    let changes: [Change; 20] = [
        ("defaults", |_| ()),
        ("no smoothing", |s| s.settings.smooth.iterations = 0),
        ("one iteration", |s| s.settings.smooth.iterations = 1),
        ("many iterations in pixels", |s| {
            s.settings.smooth.iterations = 64;
            s.settings.smooth.unit = Unit::Pixel;
        }),
        ("screen solids", |s| s.settings.refract.solids = Solids::Screen),
        ("screen solids without solids", |s| {
            s.settings.refract.solids = Solids::Screen;
            s.solids.clear();
        }),
        ("schlick", |s| s.settings.refract.fresnel = Fresnel::Schlick),
        ("reflections of the environment", |s| {
            s.settings.refract.reflections = Reflections::Environment;
        }),
        ("no contact, no scaling", |s| {
            s.settings.refract.contact = 0.0;
            s.settings.refract.radiance_scaling = false;
        }),
        ("clear liquid", |s| s.liquid.absorption = Vec3::ZERO),
        ("bilateral", |s| s.settings.smooth.filter = Filter::Bilateral),
        ("narrow range", |s| s.settings.smooth.filter = Filter::NarrowRange),
        ("newton by mip levels", |s| {
            s.settings.refract.solver = Solver::Newton;
            s.settings.refract.filter = true;
        }),
        ("mip levels of the solids too", |s| {
            s.settings.refract.solver = Solver::Plane3;
            s.settings.refract.solids = Solids::Screen;
        }),
        ("strides", |s| {
            s.settings.refract.solver = Solver::March;
            s.settings.refract.stride = 4;
        }),
        ("secant", |s| s.settings.refract.solver = Solver::Secant),
        ("gathered caustics", |s| s.settings.caustics.method = Method::Gather),
        ("straight light", |s| s.settings.caustics.method = Method::Straight),
        ("several fluids", |s| {
            s.fluids = [Vec3::X, Vec3::Y].map(Medium::clear).to_vec();
        }),
        ("aces, many samples", |s| {
            s.settings.tonemap.curve = Curve::Aces;
            s.settings.refract.samples = 64;
        }),
    ];
    for diagnose in [false, true] {
        for (what, change) in changes {
            let mut scene = Scene { solids: solids(), lights: lights(), ..Scene::default() };
            change(&mut scene);
            let splats = splats(3, 1);
            let input = FrameInput::new(&scene, &camera(), &splats, UVec2::new(20, 10));
            device.render(&mut renderer, FrameInput { diagnose, ..input });
            assert_eq!(device.errors(), [""; 0], "{what}, diagnose {diagnose}");
        }
    }
}

/// Splat counts may change arbitrarily between frames, whose buffers are reused.
#[test]
fn any_number_of_splats_is_valid() {
    let device = Checked::new();
    let mut renderer = Renderer::new(&device.gpu);
    for (aggregates, splashes) in [(0, 0), (0, 2), (2, 0), (1000, 5), (3, 1000), (0, 0), (1, 1)] {
        let (scene, splats) = (scene(), splats(aggregates, splashes));
        let input = FrameInput::new(&scene, &camera(), &splats, UVec2::new(9, 9));
        device.render(&mut renderer, input);
        assert_eq!(device.errors(), [""; 0], "{aggregates} aggregates, {splashes} splashes");
    }
}

/// Callers may draw into textures of any format; each format has its pipeline.
#[test]
fn every_target_format_is_valid() {
    let device = Checked::new();
    let mut renderer = Renderer::new(&device.gpu);
    let size = UVec2::new(16, 8);
    for format in [
        wgpu::TextureFormat::Rgba8Unorm,
        wgpu::TextureFormat::Bgra8UnormSrgb,
        wgpu::TextureFormat::Rgba16Float,
    ] {
        let target = target(&device.gpu, format, size);
        let (scene, splats) = (scene(), splats(2, 0));
        let input = FrameInput::new(&scene, &camera(), &splats, size);
        renderer.render(input, Target::View(&target, format)).expect("a valid scene");
        assert_eq!(device.errors(), [""; 0], "{format:?}");
    }
}

/// On a device with timestamps, each pass that ran has a span.
#[test]
fn timed_frames_are_valid() {
    let device = Checked::with(wgpu::Features::TIMESTAMP_QUERY);
    let mut renderer = Renderer::new(&device.gpu);
    let size = UVec2::new(16, 8);
    let target = Picture::new(&device.gpu, size).expect("the size is allowed");
    let mut times = |splashes: usize| {
        let (scene, splats) = (scene(), splats(2, splashes));
        let input = FrameInput::new(&scene, &camera(), &splats, size);
        renderer.render(FrameInput { timing: true, ..input }, &target).expect("a valid scene")
    };
    let (without, with) = (times(0), times(2));
    assert_eq!(device.errors(), [""; 0]);
    assert_eq!(with.len(), without.len() + 1, "splashes are a separate pass");
}

/// Negative test: the device reports a target whose format differs from the announced one.
#[test]
fn device_reports_planted_errors() {
    let device = Checked::new();
    let mut renderer = Renderer::new(&device.gpu);
    let size = UVec2::new(16, 8);
    let target = target(&device.gpu, wgpu::TextureFormat::Rgba16Float, size);
    let (scene, splats) = (scene(), splats(2, 0));
    renderer
        .render(
            FrameInput::new(&scene, &camera(), &splats, size),
            Target::View(&target, wgpu::TextureFormat::Rgba8Unorm),
        )
        .expect("limpid does not know the view's format");
    let errors = device.errors();
    assert!(errors.iter().any(|e| e.contains("Rgba16Float")), "{errors:?}");
}

fn target(gpu: &Gpu, format: wgpu::TextureFormat, size: UVec2) -> wgpu::TextureView {
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("target"),
        size: wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        view_formats: &[],
    });
    texture.create_view(&Default::default())
}

/// Empty sizes, and sizes whose byte count overflows or exceeds limits, are refused.
#[test]
fn impossible_sizes_are_refused() {
    let gpu = Checked::new().gpu;
    for size in [UVec2::MAX, UVec2::new(1 << 20, 1), UVec2::ZERO, UVec2::new(3, 0)] {
        assert!(gpu.check_size(size).is_err(), "{size}");
    }
    assert!(gpu.check_size(UVec2::new(640, 480)).is_ok());
}
