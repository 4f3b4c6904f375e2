//! Images of the first interface of each pixel, for programs that compose pictures: `shaders/surface/`.
//!
//! Drawn only if asked for.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::{UVec2, Vec3};
use wgpu::TextureViewDimension::{D2, D2Array};

use super::Layers;
use super::scene_binding::SceneVariant;
use super::view_passes::ViewPasses;
use crate::camera::{CameraUniform, View};
use crate::error::{Error, Limited, Result};
use crate::gpu::{self, Gpu, Span};
use crate::motion::Motion;

/// `Params` of `surface/images.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Params {
    /// Rotation into the view of the frame before: three columns, each padded with a 0.
    pub previous_from_world: [[f32; 4]; 3],
    /// This frame's eye relative to that of the frame before, m.
    pub offset: [f32; 3],
    /// Time since the frame before, s.
    pub seconds: f32,
    /// `tangent` of the camera of the frame before.
    pub previous_tangent: [f32; 2],
    /// `shift` of the camera of the frame before.
    pub previous_shift: [f32; 2],
    /// Largest difference in depth of particles whose velocities are averaged: their radius, m.
    pub reach: f32,
    /// Padding.
    pub pad: [f32; 3],
}

impl Params {
    /// The parameters of a frame of a view, whose particles have `radius`, m.
    pub fn new(view: &View, motion: &Motion, size: UVec2, radius: f32) -> Self {
        let previous = motion.previous.unwrap_or(*view);
        let CameraUniform { view_from_world, tangent, shift, .. } =
            previous.uniform(size, previous.eye, 1.0);
        Self {
            previous_from_world: view_from_world,
            offset: (view.eye - previous.eye).as_vec3().to_array(),
            seconds: motion.seconds,
            previous_tangent: tangent.to_array(),
            previous_shift: shift.to_array(),
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
    /// Pixels that the surface has moved since the frame before, right and down; share of the pixel that the
    /// liquid covers; number of the fluid, from 0.
    pub motion: wgpu::Texture,
}

/// What a frame's images depend on.
#[derive(Debug, Clone, Copy)]
pub struct Request {
    /// The particles' velocities are known.
    pub velocities: bool,
    /// The frame has splashes.
    pub splash: bool,
    /// A host has drawn the opaque scene.
    pub host: bool,
    /// Rays per pixel.
    pub samples: u32,
}

/// Specialisation: splashes, host, velocities, rays per pixel, scene, and whether the view is orthographic.
type Variant = ([bool; 3], u32, SceneVariant, bool);

/// Draws the images of the first interface.
#[derive(Debug)]
pub struct Surface {
    /// Output; `None` before it was asked for.
    pub images: Option<SurfaceImages>,
    pipelines: HashMap<Variant, wgpu::ComputePipeline>,
    params: wgpu::Buffer,
    velocities: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
}

impl Surface {
    /// Creates the layout; pipelines are compiled on first use.
    pub fn new(gpu: &Gpu) -> Self {
        let bindings = [
            gpu::uniform::<Params>(),
            gpu::sampled(D2Array),
            gpu::sampled(D2Array),
            gpu::sampled(D2),
            gpu::sampled_integers(),
            gpu::sampled_integers(),
            gpu::storage_of(4),
            gpu::storage_texture(Layers::FORMAT, D2),
            gpu::storage_texture(Layers::FORMAT, D2),
        ];
        Self {
            images: None,
            pipelines: HashMap::new(),
            params: gpu::uniform_buffer::<Params>(gpu, "surface"),
            velocities: gpu::buffer_with(gpu, "velocities", wgpu::BufferUsages::STORAGE, &[0f32]),
            layout: gpu.layout("surface", wgpu::ShaderStages::COMPUTE, &bindings),
        }
    }

    /// Allocates the images, uploads the motion, and compiles what is new.
    ///
    /// # Errors
    /// [`Error::Limit`] for more velocities than the device can bind.
    pub fn prepare(
        &mut self,
        gpu: &Gpu,
        eye: &ViewPasses,
        request: Request,
        motion: &Motion,
        params: &Params,
        size: UVec2,
    ) -> Result<()> {
        if self.images.as_ref().is_none_or(|images| extent(&images.surface) != size) {
            self.resize(gpu, size);
        }
        gpu.queue.write_buffer(&self.params, 0, bytemuck::bytes_of(params));
        self.upload(gpu, &motion.velocities)?;
        let camera = &eye.camera;
        let key = variant(eye, request);
        let ([splash, host, velocities], samples, scene, _) = key;
        self.pipelines.entry(key).or_insert_with(|| {
            let layouts = [&camera.layout, &self.layout, &eye.scene.layout];
            let switch = |on: bool| f64::from(u8::from(on));
            let own = [
                ("SPLASH", switch(splash)),
                ("HOST", switch(host)),
                ("VELOCITIES", switch(velocities)),
                ("SAMPLES", samples.into()),
            ];
            let constants = [&own[..], &scene.constants(), &camera.constants()].concat();
            gpu::compute_pipeline(gpu, "surface/images.wgsl", "images", &layouts, &constants)
        });
        Ok(())
    }

    fn resize(&mut self, gpu: &Gpu, size: UVec2) {
        let usage = wgpu::TextureUsages::STORAGE_BINDING
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::COPY_SRC;
        let image = |label: &str| gpu::texture(gpu, label, size, 1, Layers::FORMAT, usage);
        self.images = Some(SurfaceImages { surface: image("surface"), motion: image("motion") });
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
            self.velocities = gpu::buffer_with(gpu, "velocities", usage, velocities);
        } else {
            gpu.queue.write_buffer(&self.velocities, 0, bytemuck::cast_slice(velocities));
        }
        Ok(())
    }

    /// Records the images; requires [`Surface::prepare`] for the same frame.
    pub fn record(
        &self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        eye: &ViewPasses,
        request: Request,
        span: Span<'_>,
    ) {
        let Some(images) = &self.images else { return };
        let camera = &eye.camera;
        let tags =
            eye.images.splat.tags.each_ref().map(|tags| tags.create_view(&Default::default()));
        let texture_views = [&eye.images.gbuffer.planes, &images.surface, &images.motion];
        let views = texture_views.map(|texture| gpu::layer_view(texture, 0));
        let resources = [
            self.params.as_entire_binding(),
            wgpu::BindingResource::TextureView(&eye.aggregate_layers().view),
            wgpu::BindingResource::TextureView(&eye.images.splat.splash.view),
            wgpu::BindingResource::TextureView(&views[0]),
            wgpu::BindingResource::TextureView(&tags[0]),
            wgpu::BindingResource::TextureView(&tags[1]),
            self.velocities.as_entire_binding(),
            wgpu::BindingResource::TextureView(&views[1]),
            wgpu::BindingResource::TextureView(&views[2]),
        ];
        let group = gpu::bind_group(gpu, "surface", &self.layout, &resources);
        let (x, y) = gpu::workgroups(extent(&images.surface));
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("surface"),
            timestamp_writes: span.compute(),
        });
        pass.set_pipeline(&self.pipelines[&variant(eye, request)]);
        pass.set_bind_group(0, &camera.group, &[]);
        pass.set_bind_group(1, &group, &[]);
        pass.set_bind_group(2, &eye.scene.group, &[]);
        pass.dispatch_workgroups(x, y, 1);
    }
}

fn variant(eye: &ViewPasses, request: Request) -> Variant {
    let Request { velocities, splash, host, samples } = request;
    let switches = [splash, host, velocities];
    (switches, samples, eye.scene.variant, eye.camera.is_orthographic())
}

fn extent(texture: &wgpu::Texture) -> UVec2 {
    UVec2::new(texture.width(), texture.height())
}
