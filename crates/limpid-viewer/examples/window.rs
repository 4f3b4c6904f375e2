//! Draws a moving liquid in a window of winit; `window 3` closes it after three frames.
//!
//! ```sh
//! cargo run --release -p limpid-viewer --example window
//! ```

use std::{error::Error, sync::Arc};

use limpid::frame::{FrameInput, Target};
use limpid::glam::{DVec3, UVec2, Vec3};
use limpid::liquid::{Particles, classify::classify};
use limpid::look::{Body, Framing, Look};
use limpid::{gpu::Gpu, renderer::Renderer, wgpu};
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::window::{Window, WindowId};

/// Half of the distance between particles, m.
const RADIUS: f32 = 0.025;

/// A wave, y up, m: a simulation has its particles in its place.
fn wave(frame: u32) -> Particles {
    let points = (0..8000).map(|i| [i % 40, i / 40 % 10, i / 400].map(|x| x as f32));
    let lift = |p: Vec3| Vec3::Y * 0.25 * p.y * (0.3 * p.x - 0.1 * frame as f32).sin();
    let points = points.map(Vec3::from).map(|p| 2.0 * RADIUS * (p + lift(p)));
    Particles::from_positions(points.collect())
}

struct Canvas {
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    gpu: Gpu,
    renderer: Renderer,
}

impl Canvas {
    async fn open(window: Arc<Window>) -> Result<Self, Box<dyn Error>> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let surface = instance.create_surface(window.clone())?;
        let adapter =
            wgpu::util::initialize_adapter_from_env_or_default(&instance, Some(&surface)).await?;
        let (device, queue) = adapter.request_device(&Default::default()).await?;
        let config = surface.get_default_config(&adapter, 1, 1).ok_or("no format")?;
        let gpu = Gpu::from_device(device, queue);
        Ok(Self { window, surface, config, renderer: Renderer::new(&gpu), gpu })
    }

    fn draw(&mut self, frame: u32) -> Result<(), Box<dyn Error>> {
        let size = UVec2::from(<[u32; 2]>::from(self.window.inner_size())).max(UVec2::ONE);
        (self.config.width, self.config.height) = size.into();
        if self.surface.get_configuration().as_ref() != Some(&self.config) {
            self.surface.configure(&self.gpu.device, &self.config);
        }
        use wgpu::CurrentSurfaceTexture::{Suboptimal, Success};
        let (Success(shown) | Suboptimal(shown)) = self.surface.get_current_texture() else {
            return Ok(());
        };
        let body = Body::filling(DVec3::ZERO, DVec3::new(2.0, 0.6, 1.0), RADIUS);
        let (scene, camera) = (Look::Daylight.scene(&body), body.camera(Framing::of(size)));
        let splats = classify(&wave(frame), RADIUS, &scene.settings.classify);
        let view = shown.texture.create_view(&Default::default());
        let input = FrameInput::new(&scene, &camera, &splats, size);
        self.renderer.render(input, Target::View(&view, self.config.format))?;
        self.gpu.queue.present(shown);
        Ok(())
    }
}

/// The numbers of the frames to draw, and where.
struct App(std::ops::Range<u32>, Option<Canvas>);

impl winit::application::ApplicationHandler for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        let window = events.create_window(Window::default_attributes()).expect("a window");
        self.1 = Some(pollster::block_on(Canvas::open(window.into())).expect("a device"));
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(canvas) = &mut self.1 else { return };
        match event {
            WindowEvent::RedrawRequested => match self.0.next() {
                Some(frame) => canvas.draw(frame).expect("a picture"),
                None => events.exit(),
            },
            WindowEvent::CloseRequested => events.exit(),
            _ => return,
        }
        canvas.window.request_redraw();
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let frames = std::env::args().nth(1).map_or(Ok(u32::MAX), |frames| frames.parse())?;
    Ok(EventLoop::new()?.run_app(&mut App(0..frames, None))?)
}
