//! Support for tests of rendered frames: hand-made splats, a shared renderer, its images by name, and
//! the same geometry in 64 bits.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use glam::{DMat3, DVec2, DVec3, Mat3, Quat, UVec2, Vec3};
use image::RgbaImage;
use limpid::aov::{self, Aov};
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::liquid::classify::{Splat, Splats};
use limpid::offscreen::Picture;
use limpid::renderer::Renderer;
use limpid::scene::{Liquid, Scene, Shape, Solid, Surface};
use limpid::settings::Settings;

/// A device and a renderer.
pub(crate) struct Harness {
    pub(crate) gpu: Gpu,
    pub(crate) renderer: Renderer,
}

/// The renderer shared by all tests of a program, since a software adapter takes seconds to compile each
/// variant. `frames.rs` tests that frames do not depend on earlier ones.
///
/// `None` without an adapter, unless the environment requires one.
pub(crate) fn harness() -> Option<MutexGuard<'static, Harness>> {
    static HARNESS: OnceLock<Option<Mutex<Harness>>> = OnceLock::new();
    let open = || {
        let gpu = gpu()?;
        let renderer = Renderer::new(&gpu);
        Some(Mutex::new(Harness { gpu, renderer }))
    };
    // A poisoned lock is harmless: the next frame replaces all state of a failed test.
    let harness = HARNESS.get_or_init(open).as_ref()?;
    Some(harness.lock().unwrap_or_else(PoisonError::into_inner))
}

/// A new device, under the same condition.
pub(crate) fn gpu() -> Option<Gpu> {
    let set = |name: &str, value: &str| std::env::var(name).is_ok_and(|v| v == value);
    match Gpu::headless() {
        Ok(gpu) => Some(gpu),
        Err(e) if set("LIMPID_REQUIRE_GPU", "1") || set("CI", "true") => panic!("{e}"),
        Err(e) => {
            eprintln!("not run: {e}");
            None
        }
    }
}

/// The device of the tests with other limits.
pub(crate) fn limited(gpu: &Gpu, change: impl FnOnce(&mut wgpu::Limits)) -> Gpu {
    let wanted = gpu.device.adapter_info();
    let descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    let adapters = wgpu::Instance::new(descriptor).enumerate_adapters(wanted.backend.into());
    let adapter = pollster::block_on(adapters).into_iter().find(|a| a.get_info() == wanted);
    let adapter = adapter.expect("the adapter of the other device");
    let mut required_limits = adapter.limits();
    change(&mut required_limits);
    let descriptor = wgpu::DeviceDescriptor { required_limits, ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
        .expect("limits below the adapter's");
    Gpu::from_device(device, queue)
}

impl Harness {
    /// Draws a frame with diagnostics and reads all its images back.
    pub(crate) fn render(
        &mut self,
        scene: &Scene,
        view: impl Into<limpid::camera::View>,
        splats: &Splats,
        size: UVec2,
    ) -> FrameImages {
        render(&self.gpu, &mut self.renderer, diagnosed(scene, view, splats, size))
    }
}

/// The input of a frame with diagnostics.
pub(crate) fn diagnosed<'a>(
    scene: &'a Scene,
    view: impl Into<limpid::camera::View>,
    splats: &'a Splats,
    size: UVec2,
) -> FrameInput<'a> {
    FrameInput { diagnose: true, ..FrameInput::new(scene, view, splats, size) }
}

/// Draws a frame and reads all its images back.
pub(crate) fn render(gpu: &Gpu, renderer: &mut Renderer, input: FrameInput<'_>) -> FrameImages {
    let size = input.size;
    let frame = Picture::new(gpu, size).expect("a frame");
    renderer.render(input, &frame).expect("the frame is drawn");
    let picture = frame.read(gpu).expect("the picture is read");
    let parts = aov::read(gpu, &renderer.images(), &Aov::ALL).expect("the images are read");
    let picture_sized = parts.into_iter().filter(|part| part.name == "limpid");
    let channels: HashMap<_, _> =
        picture_sized.flat_map(|part| part.channels).map(|c| (c.name, c.values)).collect();
    for values in channels.values() {
        assert_eq!(values.len(), (size.x * size.y) as usize);
    }
    FrameImages { size, channels, picture }
}

/// A frame's images.
pub(crate) struct FrameImages {
    pub(crate) size: UVec2,
    pub(crate) channels: HashMap<String, Vec<f32>>,
    pub(crate) picture: RgbaImage,
}

impl FrameImages {
    pub(crate) fn channel(&self, name: &str) -> &[f32] {
        self.channels.get(name).unwrap_or_else(|| panic!("no channel {name}"))
    }

    pub(crate) fn has(&self, name: &str) -> bool {
        self.channels.contains_key(name)
    }

    pub(crate) fn at(&self, name: &str, p: UVec2) -> f64 {
        self.channel(name)[(p.y * self.size.x + p.x) as usize].into()
    }

    pub(crate) fn normal(&self, name: &str, p: UVec2) -> DVec3 {
        let axis = |axis: &str| self.at(&format!("{name}.{axis}"), p);
        DVec3::new(axis("X"), axis("Y"), axis("Z"))
    }

    pub(crate) fn radiance(&self, p: UVec2) -> DVec3 {
        let color = |color: &str| self.at(&format!("radiance.{color}"), p);
        DVec3::new(color("R"), color("G"), color("B"))
    }

    pub(crate) fn pixels(&self) -> impl Iterator<Item = UVec2> + use<> {
        let size = self.size;
        (0..size.y).flat_map(move |y| (0..size.x).map(move |x| UVec2::new(x, y)))
    }

    /// No image has a NaN or infinite value.
    #[track_caller]
    pub(crate) fn assert_finite(&self) {
        for (name, values) in &self.channels {
            if let Some(i) = values.iter().position(|v| !v.is_finite()) {
                let (x, y) = (i as u32 % self.size.x, i as u32 / self.size.x);
                panic!("{name} is {} at ({x}, {y})", values[i]);
            }
        }
    }
}

/// Mean absolute difference of radiance between two frames.
pub(crate) fn mean_difference(a: &FrameImages, b: &FrameImages) -> f64 {
    let total: f64 = a.pixels().map(|p| (a.radiance(p) - b.radiance(p)).abs().element_sum()).sum();
    total / (3 * a.size.x * a.size.y) as f64
}

/// An ellipsoid with semi-axes `axes` along the rotated x, y and z.
pub(crate) fn ellipsoid(centre: Vec3, axes: Vec3, turn: Quat) -> Splat {
    let turn = Mat3::from_quat(turn).as_dmat3();
    let a = turn * DMat3::from_diagonal(axes.as_dvec3()) * turn.transpose();
    Splat {
        centre: centre.to_array(),
        radius: axes.min_element(),
        diagonal: [a.x_axis.x, a.y_axis.y, a.z_axis.z].map(|x| x as f32),
        particle: 0,
        off_diagonal: [a.y_axis.x, a.z_axis.x, a.z_axis.y].map(|x| x as f32),
        tags: 0,
    }
}

pub(crate) fn sphere(centre: Vec3, radius: f32) -> Splat {
    ellipsoid(centre, Vec3::splat(radius), Quat::IDENTITY)
}

/// Splats of a liquid whose particles all have radius r.
pub(crate) fn splats(aggregates: &[Splat], splashes: &[Splat], r: f32) -> Splats {
    let of_size = |splats: &[Splat]| splats.iter().map(|s| Splat { radius: r, ..*s }).collect();
    Splats {
        aggregates: of_size(aggregates),
        splashes: of_size(splashes),
        radius: r,
        ..Splats::default()
    }
}

/// Clear water under a white sky, without smoothing, so that the layers hold the exact ellipsoids.
pub(crate) fn scene() -> Scene {
    let mut settings = Settings::default();
    settings.smooth.iterations = 0;
    settings.refract.edge_samples = 1;
    Scene {
        liquid: Liquid { absorption: Vec3::ZERO, ..Liquid::default() },
        environment: Environment::Constant(Vec3::ONE),
        settings,
        ..Scene::default()
    }
}

/// A solid whose radiance is `color`.
pub(crate) fn glowing(shape: Shape, color: Vec3) -> Solid {
    Solid { shape, surface: Surface::Color(color), lit: false }
}

/// A camera at `distance` on the z axis that looks at the origin: view space is a translated world space.
pub(crate) fn on_axis(distance: f32, fov_y: f32) -> Camera {
    let eye = DVec3::Z * f64::from(distance);
    Camera { eye, target: DVec3::ZERO, up: Vec3::Y, fov_y, near: None, lens: None }
}

/// A camera in 64 bits.
pub(crate) struct View {
    eye: DVec3,
    /// Rows: right, up and back, in world space.
    axes: [DVec3; 3],
    pub(crate) tangent: DVec2,
    size: DVec2,
    pub(crate) near: f64,
}

impl View {
    pub(crate) fn new(camera: &Camera, size: UVec2) -> Self {
        let eye = camera.eye;
        let back = (eye - camera.target).normalize();
        let right = camera.up.as_dvec3().cross(back).normalize();
        let tangent_y = (0.5 * f64::from(camera.fov_y).to_radians()).tan();
        let size = size.as_dvec2();
        Self {
            eye,
            axes: [right, back.cross(right), back],
            tangent: DVec2::new(tangent_y * size.x / size.y, tangent_y),
            size,
            near: camera.near().into(),
        }
    }

    /// Ray of unit depth through pixel position `u`.
    pub(crate) fn omega(&self, u: DVec2) -> DVec3 {
        let ndc = 2.0 * u / self.size - 1.0;
        DVec3::new(ndc.x * self.tangent.x, -ndc.y * self.tangent.y, -1.0)
    }

    /// Ray of unit depth through the centre of pixel p.
    pub(crate) fn through(&self, p: UVec2) -> DVec3 {
        self.omega(p.as_dvec2() + 0.5)
    }

    /// Pixel position of a point in front of the eye.
    pub(crate) fn pixel(&self, x: DVec3) -> DVec2 {
        let ndc = x.truncate() / (-x.z * self.tangent);
        (DVec2::new(ndc.x, -ndc.y) * 0.5 + 0.5) * self.size
    }

    /// Side of a pixel at unit depth.
    pub(crate) fn footprint(&self) -> f64 {
        2.0 * self.tangent.y / self.size.y
    }

    pub(crate) fn vector(&self, world: DVec3) -> DVec3 {
        DVec3::from_array(self.axes.map(|axis| axis.dot(world)))
    }

    pub(crate) fn point(&self, world: DVec3) -> DVec3 {
        self.vector(world - self.eye)
    }

    pub(crate) fn world_vector(&self, view: DVec3) -> DVec3 {
        view.x * self.axes[0] + view.y * self.axes[1] + view.z * self.axes[2]
    }

    pub(crate) fn world_point(&self, view: DVec3) -> DVec3 {
        self.eye + self.world_vector(view)
    }
}

/// A splat's ellipsoid in view space, in 64 bits.
pub(crate) struct Ellipsoid {
    pub(crate) centre: DVec3,
    /// Radius of the particle.
    pub(crate) radius: f64,
    to_sphere: DMat3,
}

impl Ellipsoid {
    pub(crate) fn new(view: &View, splat: &Splat) -> Self {
        let ([xx, yy, zz], [xy, xz, yz]) = (splat.diagonal, splat.off_diagonal);
        let world = Mat3::from_cols_array_2d(&[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]);
        let [right, up, back] = view.axes;
        let world_from_view = DMat3::from_cols(right, up, back);
        Self {
            centre: view.point(Vec3::from_array(splat.centre).as_dvec3()),
            radius: splat.radius.into(),
            to_sphere: world.as_dmat3().inverse() * world_from_view,
        }
    }

    /// 1 − f² with the line's distance f from the centre in the space where the ellipsoid is the unit
    /// sphere: positive if the line hits the ellipsoid.
    pub(crate) fn discriminant(&self, o: DVec3, d: DVec3) -> f64 {
        let (start, d) = (self.to_sphere * (o - self.centre), self.to_sphere * d);
        1.0 - (start - start.dot(d) / d.length_squared() * d).length_squared()
    }

    /// Parameters t at which the line o + t d enters and leaves.
    pub(crate) fn hits(&self, o: DVec3, d: DVec3) -> Option<[f64; 2]> {
        let discriminant = self.discriminant(o, d);
        let (start, d) = (self.to_sphere * (o - self.centre), self.to_sphere * d);
        let middle = -start.dot(d) / d.length_squared();
        let half = (discriminant.max(0.0) / d.length_squared()).sqrt();
        (discriminant >= 0.0).then_some([middle - half, middle + half])
    }

    /// Outward unit normal at a point of the surface.
    pub(crate) fn normal(&self, x: DVec3) -> DVec3 {
        (self.to_sphere.transpose() * (self.to_sphere * (x - self.centre))).normalize()
    }
}

/// Uniform in 0 to 1, from a linear congruential generator (Knuth's MMIX).
pub(crate) fn noise(seed: &mut u64) -> f32 {
    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*seed >> 40) as f32 / (1u64 << 24) as f32
}

/// Uniform in the cube from −1 to 1.
pub(crate) fn noise_vector(seed: &mut u64) -> Vec3 {
    Vec3::from_array([(); 3].map(|()| 2.0 * noise(seed) - 1.0))
}

/// A rotation about a random axis by a random angle.
pub(crate) fn noise_turn(seed: &mut u64) -> Quat {
    Quat::from_axis_angle(noise_vector(seed).normalize_or(Vec3::X), 6.3 * noise(seed))
}
