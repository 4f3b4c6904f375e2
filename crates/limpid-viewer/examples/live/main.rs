//! A liquid that lives on the graphics card: simulated, classified and drawn there, so that no particle ever reaches the host.
//!
//! ```sh
//! cargo run --release -p limpid-viewer --example live                          # a window
//! cargo run --release -p limpid-viewer --example live -- live.png 24 60000     # frame 24 of 60,000 particles
//! ```
//!
//! `drawing.rs` has all the calls that draw with limpid. The page and the example in Bevy draw the simulation too.

mod drawing;
mod simulation;

use std::error::Error;

use limpid::frame::{Picture, Target};
use limpid::glam::UVec2;
use limpid::gpu::Gpu;
use limpid::wgpu;

use drawing::Live;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let Some(path) = arguments.next() else { return show() };
    let frames: u32 = arguments.next().unwrap_or("60".into()).parse()?;
    let count = arguments.next().unwrap_or("100000".into()).parse()?;
    let gpu = Gpu::headless()?;
    let size = UVec2::new(640, 400);
    let (mut live, picture) = (Live::new(&gpu, count)?, Picture::new(&gpu, size)?);
    for _ in 0..frames {
        live.step();
    }
    live.draw(&picture, size, 0.4)?;
    picture.read(&gpu)?.save(&path)?;
    println!("{path}: frame {frames} of {count} particles");
    Ok(())
}

/// Shows the simulation in a window.
fn show() -> Result<(), Box<dyn Error>> {
    let create = |creation: &eframe::CreationContext<'_>| {
        let state = creation.wgpu_render_state.clone().ok_or("the window is not drawn by wgpu")?;
        let gpu = Gpu::from_device(state.device.clone(), state.queue.clone());
        let live = Live::new(&gpu, 100_000)?;
        Ok(Box::new(Window { live, state, shown: None }) as Box<dyn eframe::App>)
    };
    eframe::run_native("limpid live", Default::default(), Box::new(create))?;
    Ok(())
}

struct Window {
    live: Live,
    state: eframe::egui_wgpu::RenderState,
    /// The picture in the window, with its number there.
    shown: Option<(wgpu::Texture, eframe::egui::TextureId)>,
}

impl eframe::App for Window {
    fn ui(&mut self, ui: &mut eframe::egui::Ui, _frame: &mut eframe::Frame) {
        let pixels = ui.available_size() * ui.ctx().pixels_per_point();
        let size = UVec2::new(pixels.x as u32, pixels.y as u32).max(UVec2::ONE);
        let format = wgpu::TextureFormat::Rgba8Unorm;
        let fits = |(shown, _): &(wgpu::Texture, _)| (shown.width(), shown.height()) == size.into();
        if let Some((_, id)) = self.shown.take_if(|shown| !fits(shown)) {
            self.state.renderer.write().free_texture(&id);
        }
        let (texture, id) = self.shown.take().unwrap_or_else(|| {
            let texture = self.state.device.create_texture(&wgpu::TextureDescriptor {
                label: Some("picture"),
                size: wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                    | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            });
            let view = texture.create_view(&Default::default());
            let mut renderer = self.state.renderer.write();
            let nearest = wgpu::FilterMode::Nearest;
            let id = renderer.register_native_texture(&self.state.device, &view, nearest);
            (texture, id)
        });
        let view = texture.create_view(&Default::default());
        let turn = 0.1 * ui.input(|input| input.time);
        self.live.step();
        if let Err(e) = self.live.draw(Target::View(&view, format), size, turn) {
            ui.label(e.to_string());
        }
        ui.image((id, ui.available_size()));
        self.shown = Some((texture, id));
        ui.ctx().request_repaint();
    }
}
