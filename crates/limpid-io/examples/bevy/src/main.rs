//! Draws limpid's liquid into the frame of an engine, [Bevy](https://bevy.org).
//!
//! ```sh
//! cd crates/limpid-io/examples/bevy
//! cargo run                        # with Rust 1.97.1, which Bevy 0.20 asks for
//! cargo run --ignore-rust-version  # with an older one
//! cargo run -- live                # a breaking dam that is simulated on the graphics card
//! ```
//!
//! Bevy draws a ground and a cube, lit by a sun, into its own linear colour and depth. Between its opaque and its
//! transparent pass, the system [`draw_liquid`] has limpid draw the built-in demo around the cube: on Bevy's device,
//! into Bevy's command encoder. With `live`, the particles are simulated there too, and never reach the host.
//! Bevy then goes on with its frame: it tone-maps its colour, and saves `bevy.png`. It needs no window and no display; a
//! window instead of the picture changes nothing in the system.

#[path = "../../../../limpid-viewer/examples/live/simulation.rs"]
mod simulation;

use std::collections::HashMap;
use std::time::Duration;

use bevy::app::ScheduleRunnerPlugin;
use bevy::camera::{Hdr, RenderTarget};
use bevy::core_pipeline::Core3d;
use bevy::core_pipeline::core_3d::{main_opaque_pass_3d, main_transparent_pass_3d};
use bevy::diagnostic::FrameCount;
use bevy::image::{ImageAddressMode, ImageSampler, ImageSamplerDescriptor};
use bevy::math::Affine2;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::render::view::{ExtractedView, Tonemapping, ViewDepthStencilTexture, ViewTarget};
use bevy::render::{Render, RenderApp, RenderPlugin, RenderSystems};
use bevy::window::ExitCondition;

use limpid::camera::View;
use limpid::environment::Environment;
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::host::Host;
use limpid::liquid::DeviceParticles;
use limpid::liquid::classify::{Classifier, Splats};
use limpid::renderer::Renderer;
use limpid::scene::Scene;
// limpid and Bevy use the same wgpu, but not the same glam.
use limpid::{glam, wgpu};

use limpid_io::input::Input;
use simulation::Simulation;

/// Bevy's sky, linear.
const SKY: [f32; 3] = [0.55, 0.7, 0.9];
/// The frame that is saved: Bevy loads its shaders during the first ones, and the dam takes some to break.
const SAVED_FRAME: u32 = 24;
/// Particles of the dam.
const PARTICLES: u32 = 40_000;

fn main() -> Result<AppExit> {
    let liquid = Liquid::demo()?;
    let is_live = std::env::args().any(|argument| argument == "live");
    let mut app = App::new();
    app.add_plugins(
        DefaultPlugins
            .set(WindowPlugin {
                primary_window: None,
                exit_condition: ExitCondition::DontExit,
                ..default()
            })
            .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() }),
    )
    .add_plugins(ScheduleRunnerPlugin::run_loop(Duration::ZERO))
    .insert_resource(ClearColor(Color::linear_rgb(SKY[0], SKY[1], SKY[2])))
    .add_systems(Startup, build_world)
    .add_systems(Update, save_picture);
    let render_app = app.sub_app_mut(RenderApp);
    render_app.insert_resource(liquid).add_systems(
        Core3d,
        draw_liquid.after(main_opaque_pass_3d).before(main_transparent_pass_3d),
    );
    if is_live {
        render_app.add_systems(Render, simulate.in_set(RenderSystems::PrepareResources));
    }
    Ok(app.run())
}

// ---- limpid: what is drawn, and the system that draws it.

/// The liquid of the render world. A program with moving particles replaces the splats in every frame, as [`simulate`] does.
#[derive(Resource)]
struct Liquid {
    scene: Scene,
    splats: Splats,
}

impl Liquid {
    fn demo() -> Result<Self> {
        let (loader, project) = Input::demo()?.resolve()?;
        let loaded = loader.load(&loader.sequence.frames[0], &project.scene)?;
        let mut scene = project.scene.clone();
        // Rays that leave the picture see this sky.
        scene.environment = Environment::Constant(SKY.into());
        scene.solids.clear();
        // Coverage, so that only the liquid is added to Bevy's colour.
        scene.settings.refract.transparent = true;
        Ok(Self { scene, splats: loaded.splats })
    }
}

/// Simulates a frame of the dam, and classifies its particles, on Bevy's device.
fn simulate(
    mut liquid: ResMut<Liquid>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut dam: Local<Option<(Simulation, Classifier)>>,
) -> Result {
    let (simulation, classifier) = match &mut *dam {
        Some(dam) => dam,
        none => {
            let gpu = Gpu::from_device(device.wgpu_device().clone(), wgpu::Queue::clone(&queue));
            none.insert((Simulation::new(&gpu, PARTICLES), Classifier::new(&gpu)?))
        }
    };
    let mut encoder = device.wgpu_device().create_command_encoder(&Default::default());
    simulation.record(&mut encoder);
    // Around the cube, of which the simulation does not know.
    let particles = simulation.particles();
    let (min, max) = particles.bounds;
    let origin = -0.5 * (min + max).with_y(0.0);
    let bounds = (min + origin, max + origin);
    let particles = DeviceParticles { origin, bounds, ..particles };
    liquid.splats = classifier.record(&mut encoder, &particles, &liquid.scene)?;
    queue.submit([encoder.finish()]);
    Ok(())
}

/// Records the liquid into Bevy's frame, once for each camera, with a renderer of its own: Bevy submits all of
/// them together.
fn draw_liquid(
    view: ViewQuery<(Entity, &ExtractedView, &ViewTarget, &ViewDepthStencilTexture)>,
    liquid: Res<Liquid>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut renderers: Local<HashMap<Entity, Renderer>>,
    mut context: RenderContext,
) -> Result {
    let (camera, view, target, depth) = view.into_inner();
    // Handles of wgpu are reference-counted. Bevy wraps them, but they are limpid's types.
    let renderer = renderers.entry(camera).or_insert_with(|| {
        Renderer::new(&Gpu::from_device(device.wgpu_device().clone(), wgpu::Queue::clone(&queue)))
    });
    let color = wgpu::TextureView::clone(target.main_texture_view());
    let depth = wgpu::TextureView::clone(&depth.attachment.texture.default_view);
    let clip_from_view = double(view.clip_from_view);
    let host = Host { color: color.clone(), depth, normals: None, clip_from_view };

    let view_from_world = double(Mat4::from(view.world_from_view.affine().inverse()));
    let view = View::from_matrices(view_from_world, clip_from_view)?;
    let size = target.main_texture().size();
    let size = glam::UVec2::new(size.width, size.height);
    let input = FrameInput::new(&liquid.scene, view, &liquid.splats, size);
    let frame = renderer.prepare(FrameInput { host: Some(&host), ..input })?;
    let encoder = context.command_encoder();
    renderer.record(frame, encoder);
    renderer.composite(encoder, &color, target.main_texture_format());
    Ok(())
}

/// The matrix of Bevy in limpid's precision.
fn double(matrix: Mat4) -> glam::DMat4 {
    glam::DMat4::from_cols_array(&matrix.to_cols_array().map(f64::from))
}

// ---- Bevy's own: a camera, a world, a picture.

fn build_world(
    mut commands: Commands,
    mut images: ResMut<Assets<Image>>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    let picture = Image::new_target_texture(800, 600, TextureFormat::Rgba8UnormSrgb, None);
    commands.spawn((
        // limpid reads linear colour and depths, with one sample per pixel.
        Camera3d {
            depth_texture_usages: (TextureUsages::RENDER_ATTACHMENT
                | TextureUsages::TEXTURE_BINDING)
                .into(),
            ..default()
        },
        Hdr,
        Msaa::Off,
        Tonemapping::AcesFitted,
        RenderTarget::from(images.add(picture)),
        Projection::from(PerspectiveProjection { fov: 40f32.to_radians(), ..default() }),
        Transform::from_xyz(0.9, 1.5, 3.1).looking_at(Vec3::new(0.05, 0.12, 0.2), Vec3::Y),
    ));
    commands.spawn((
        DirectionalLight { illuminance: 5_000.0, shadow_maps_enabled: true, ..default() },
        Transform::from_xyz(1.0, 2.0, 1.5).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Mesh3d(meshes.add(Plane3d::default().mesh().size(24.0, 24.0))),
        MeshMaterial3d(materials.add(StandardMaterial {
            base_color_texture: Some(images.add(checker())),
            uv_transform: Affine2::from_scale(Vec2::splat(48.0)),
            perceptual_roughness: 0.9,
            ..default()
        })),
        Transform::from_xyz(0.0, -0.05, 0.0),
    ));
    commands.spawn((
        Mesh3d(meshes.add(Cuboid::from_length(0.5))),
        MeshMaterial3d(materials.add(Color::srgb(0.9, 0.35, 0.1))),
        Transform::from_xyz(0.0, 0.2, 0.2).with_rotation(Quat::from_rotation_y(0.6)),
    ));
}

/// Two light and two dark tiles, repeated.
fn checker() -> Image {
    let (light, dark) = ([216, 204, 178, 255], [90, 100, 115, 255]);
    let texels = [light, dark, dark, light].concat();
    let size = Extent3d { width: 2, height: 2, ..default() };
    let format = TextureFormat::Rgba8UnormSrgb;
    let mut image = Image::new(size, TextureDimension::D2, texels, format, default());
    image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u: ImageAddressMode::Repeat,
        address_mode_v: ImageAddressMode::Repeat,
        ..ImageSamplerDescriptor::nearest()
    });
    image
}

fn save_picture(mut commands: Commands, target: Single<&RenderTarget>, frame: Res<FrameCount>) {
    if frame.0 == SAVED_FRAME {
        commands.spawn(Screenshot(target.clone())).observe(save_to_disk("bevy.png")).observe(
            |_: On<ScreenshotCaptured>, mut exit: MessageWriter<AppExit>| {
                exit.write(AppExit::Success);
            },
        );
    }
}
