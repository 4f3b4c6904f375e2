//! Images of the first interface of each pixel, for programs that compose pictures: `shaders/surface/`.
//!
//! A render pass finds the particle in front, a compute pass writes the images. Drawn only if asked for.

use std::collections::HashMap;

use bytemuck::{Pod, Zeroable};
use glam::{UVec2, Vec3};
use wgpu::TextureViewDimension::{D2, D2Array};

use super::gbuffer::SceneVariant;
use super::splat_buffers::{self, SplatBuffers};
use super::view_passes::ViewPasses;
use super::{CameraBinding, Layers};
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
    /// Particle, from 1, and fluid in front.
    nearest: Option<[wgpu::TextureView; 2]>,
    draw: HashMap<bool, wgpu::RenderPipeline>,
    resolve: HashMap<Variant, wgpu::ComputePipeline>,
    params: wgpu::Buffer,
    velocities: wgpu::Buffer,
    layout: wgpu::BindGroupLayout,
}

const TAGS: wgpu::TextureFormat = wgpu::TextureFormat::Rg32Uint;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

impl Surface {
    /// Creates the layout; pipelines are compiled on first use.
    pub fn new(gpu: &Gpu) -> Self {
        let bindings = [
            gpu::uniform::<Params>(),
            gpu::sampled(D2Array),
            gpu::sampled(D2Array),
            gpu::sampled(D2),
            gpu::sampled_integers(),
            gpu::storage_of(4),
            gpu::storage_texture(Layers::FORMAT, D2),
            gpu::storage_texture(Layers::FORMAT, D2),
        ];
        Self {
            images: None,
            nearest: None,
            draw: HashMap::new(),
            resolve: HashMap::new(),
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
        let orthographic = camera.is_orthographic();
        self.draw.entry(orthographic).or_insert_with(|| draw_pipeline(gpu, camera));
        let key = variant(eye, request);
        let ([splash, host, velocities], samples, scene, _) = key;
        self.resolve.entry(key).or_insert_with(|| {
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
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
        let target = |label: &str, format| {
            gpu::texture(gpu, label, size, 1, format, usage).create_view(&Default::default())
        };
        self.nearest = Some([target("nearest", TAGS), target("nearest depth", DEPTH)]);
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
        classes: [&SplatBuffers; 2],
        request: Request,
        span: Span<'_>,
    ) {
        let (Some(images), Some([tags, depth])) = (&self.images, &self.nearest) else { return };
        let camera = &eye.camera;
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("surface"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: tags,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            timestamp_writes: span.first().render(),
            ..Default::default()
        });
        pass.set_pipeline(&self.draw[&camera.is_orthographic()]);
        pass.set_bind_group(0, &camera.group, &[]);
        for splats in classes {
            splats.draw(&mut pass);
        }
        drop(pass);

        let texture_views = [&eye.gbuffer.images.planes, &images.surface, &images.motion];
        let views = texture_views.map(|texture| gpu::layer_view(texture, 0));
        let resources = [
            self.params.as_entire_binding(),
            wgpu::BindingResource::TextureView(&eye.aggregate_layers().view),
            wgpu::BindingResource::TextureView(&eye.splash.layers.view),
            wgpu::BindingResource::TextureView(&views[0]),
            wgpu::BindingResource::TextureView(tags),
            self.velocities.as_entire_binding(),
            wgpu::BindingResource::TextureView(&views[1]),
            wgpu::BindingResource::TextureView(&views[2]),
        ];
        let group = gpu::bind_group(gpu, "surface", &self.layout, &resources);
        let (x, y) = gpu::workgroups(extent(&images.surface));
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("surface"),
            timestamp_writes: span.last().compute(),
        });
        pass.set_pipeline(&self.resolve[&variant(eye, request)]);
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

fn draw_pipeline(gpu: &Gpu, camera: &CameraBinding) -> wgpu::RenderPipeline {
    let file = "surface/nearest.wgsl";
    let module = gpu::shader::module(gpu, file, gpu::shader::Variant::default());
    let splats = splat_buffers::layout(gpu);
    let layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("surface"),
        bind_group_layouts: &[Some(&camera.layout), Some(&splats)],
        immediate_size: 0,
    });
    let constants = camera.constants();
    let compilation_options =
        wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() };
    gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("surface"),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: compilation_options.clone(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState {
            topology: wgpu::PrimitiveTopology::TriangleList,
            ..Default::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: Default::default(),
            bias: Default::default(),
        }),
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("nearest"),
            compilation_options,
            targets: &[Some(TAGS.into())],
        }),
        multiview_mask: None,
        cache: gpu.cache(),
    })
}
