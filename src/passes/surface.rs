//! Images of the first interface of each pixel, for programs that compose pictures: `shaders/surface/`.
//!
//! Drawn only if asked for.

mod spheres;

use bytemuck::{Pod, Zeroable};
use glam::{UVec2, Vec3};
use wgpu::BindingResource::TextureView;
use wgpu::TextureViewDimension::{D2, D2Array};

use self::spheres::SphereMotion;
use super::Layers;
use super::diffuse::{self, DiffuseImages};
use super::view_passes::ViewPasses;
use crate::camera::{CameraUniform, View};
use crate::error::{Error, Limited, Result};
use crate::gpu::{self, Bound, Commands, Gpu, Span};
use crate::motion::Motion;

/// `Before` of `surface/before.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Before {
    /// Rotation into the view of the frame before: three columns, each padded with a 0.
    pub view_from_world: [[f32; 4]; 3],
    /// This frame's eye relative to that of the frame before, m.
    pub offset: [f32; 3],
    /// Time since the frame before, s.
    pub seconds: f32,
    /// `tangent` of the camera of the frame before.
    pub tangent: [f32; 2],
    /// `shift` of the camera of the frame before.
    pub shift: [f32; 2],
    /// Largest difference in depth of particles whose velocities are averaged: their radius, m.
    pub reach: f32,
    /// Padding.
    pub pad: [f32; 3],
}

impl Before {
    /// The frame before one of a view, whose particles have `radius`, m.
    pub fn new(view: &View, motion: &Motion, size: UVec2, radius: f32) -> Self {
        let previous = motion.previous.unwrap_or(*view);
        let CameraUniform { view_from_world, tangent, shift, .. } =
            previous.uniform(size, previous.eye, 1.0);
        Self {
            view_from_world,
            offset: (view.eye - previous.eye).as_vec3().to_array(),
            seconds: motion.seconds,
            tangent: tangent.to_array(),
            shift: shift.to_array(),
            reach: radius,
            pad: [0.0; 3],
        }
    }
}

/// Images of the first interface of each pixel, without what solids hide. 32-bit floats.
#[derive(Debug, Clone)]
pub struct SurfaceImages {
    /// Outward unit normal in view space, and depth in m; 0 where no liquid is at the pixel's centre.
    pub surface: wgpu::Texture,
    /// Pixels that the surface has moved since the frame before, right and down, or foam and spray that cover half of the
    /// pixel; share of the pixel that the liquid covers; number of the fluid, from 0.
    pub motion: wgpu::Texture,
}

/// Properties of a frame that its images depend on.
#[derive(Debug, Clone, Copy)]
pub struct Request<'a> {
    /// The particles' velocities are known.
    pub velocities: bool,
    /// The frame has splashes.
    pub splash: bool,
    /// A host has drawn the opaque scene.
    pub host: bool,
    /// Rays per pixel.
    pub samples: u32,
    /// Foam, spray, bubbles and dust.
    pub spheres: Option<(&'a DiffuseImages, diffuse::Params)>,
}

/// The images of the first interface, and the velocities that they show.
#[derive(Debug)]
pub struct SurfaceBuffers {
    /// `None` before they were asked for.
    pub images: Option<SurfaceImages>,
    velocities: wgpu::Buffer,
}

/// Draws the images of the first interface.
#[derive(Debug)]
pub struct SurfacePass {
    pipeline: wgpu::ComputePipeline,
    images: Bound,
    spheres: Option<SphereMotion>,
    /// Workgroups along x and y.
    groups: (u32, u32),
}

impl SurfaceBuffers {
    /// Creates no images.
    pub fn new(gpu: &Gpu) -> Self {
        let velocities = gpu.buffer_with("velocities", wgpu::BufferUsages::STORAGE, &[0f32]);
        Self { images: None, velocities }
    }

    /// The images of a frame of `size` pixels.
    fn images(&mut self, gpu: &Gpu, size: UVec2) -> &SurfaceImages {
        let fits = |images: &SurfaceImages| extent(&images.surface) == size;
        self.images.take_if(|images| !fits(images));
        self.images.get_or_insert_with(|| {
            let usage = wgpu::TextureUsages::STORAGE_BINDING
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC;
            let image = |label: &str| gpu.texture(label, size, 1, Layers::FORMAT, usage);
            SurfaceImages { surface: image("surface"), motion: image("motion") }
        })
    }

    fn upload(&mut self, gpu: &Gpu, velocities: &[Vec3]) -> Result<()> {
        if velocities.is_empty() {
            return Ok(());
        }
        let bytes = size_of_val(velocities) as u64;
        let most = gpu.device.limits().max_storage_buffer_binding_size;
        if bytes > most.min(gpu.device.limits().max_buffer_size) {
            let problem = format!("binds at most {most} bytes of velocities, {bytes} are needed");
            return Err(Error::Limit { adapter: gpu.adapter(), problem, of: Limited::Velocities });
        }
        if self.velocities.size() < bytes {
            let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
            self.velocities = gpu.buffer_with("velocities", usage, velocities);
        } else {
            gpu.queue.write_buffer(&self.velocities, 0, bytemuck::cast_slice(velocities));
        }
        Ok(())
    }
}

impl SurfacePass {
    /// Prepares the images of a frame of `size` pixels: allocates them and uploads the motion.
    ///
    /// # Errors
    /// [`Error::Limit`] for more velocities than the device can bind.
    pub fn prepare(
        gpu: &Gpu,
        eye: &ViewPasses,
        request: Request<'_>,
        motion: &Motion,
        before: &Before,
        size: UVec2,
        kept: &mut SurfaceBuffers,
    ) -> Result<Self> {
        kept.upload(gpu, &motion.velocities)?;
        let particles = kept.velocities.clone();
        let before = gpu.buffer_with("surface", gpu::UNIFORM, &[*before]);
        let Request { velocities, splash, host, samples, spheres } = request;
        let spheres = spheres
            .map(|(spheres, params)| SphereMotion::prepare(gpu, eye, spheres, params, &before));
        let sums = match &spheres {
            Some(spheres) => spheres.sums.clone(),
            None => gpu.buffer_with("no spheres", wgpu::BufferUsages::STORAGE, &[[0i32; 4]]),
        };
        let images = kept.images(gpu, size);
        let tags =
            eye.images.splat.tags.each_ref().map(|tags| tags.create_view(&Default::default()));
        let [planes, surface, moved] =
            [&eye.images.gbuffer.planes, &images.surface, &images.motion]
                .map(|texture| gpu::layer_view(texture, 0));
        let written = gpu::storage_texture(Layers::FORMAT, D2);
        let bindings = [
            (gpu::uniform::<Before>(), before.as_entire_binding()),
            (gpu::sampled(D2Array), TextureView(&eye.aggregate_layers().view)),
            (gpu::sampled(D2Array), TextureView(&eye.images.splat.splash.view)),
            (gpu::sampled(D2), TextureView(&planes)),
            (gpu::sampled_integers(), TextureView(&tags[0])),
            (gpu::sampled_integers(), TextureView(&tags[1])),
            (gpu::storage_of(4), particles.as_entire_binding()),
            (written, TextureView(&surface)),
            (written, TextureView(&moved)),
            (gpu::storage::<[i32; 4]>(), sums.as_entire_binding()),
        ];
        let images = gpu.bind("surface", &bindings);
        let switch = |on: bool| f64::from(u8::from(on));
        let own = [
            ("SPLASH", switch(splash)),
            ("HOST", switch(host)),
            ("VELOCITIES", switch(velocities)),
            ("SPHERE_MOTION", switch(spheres.is_some())),
            ("SAMPLES", samples.into()),
        ];
        let constants =
            [&own[..], &eye.scene.variant.constants(), &eye.camera.constants()].concat();
        let layouts = [&eye.camera.layout, &images.layout, &eye.scene.layout];
        let shader = "surface/images.wgsl";
        let pipeline = gpu.compute_pipeline(shader, "images", &layouts, &constants);
        Ok(Self { pipeline, images, spheres, groups: gpu::workgroups(size) })
    }

    /// Records the images.
    pub fn record(&self, commands: &mut Commands<'_>, eye: &ViewPasses, span: Span<'_>) {
        if let Some(spheres) = &self.spheres {
            spheres.record(commands, eye, span.first());
        }
        let span = span.part(self.spheres.is_none(), true);
        let mut pass = commands.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("surface"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &eye.camera.group, &[]);
        pass.set_bind_group(1, &self.images.group, &[]);
        pass.set_bind_group(2, &eye.scene.group, &[]);
        pass.dispatch_workgroups(self.groups.0, self.groups.1, 1);
    }
}

fn extent(texture: &wgpu::Texture) -> UVec2 {
    UVec2::new(texture.width(), texture.height())
}
