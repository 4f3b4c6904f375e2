//! Films a sequence of particle files, or a wave of its own.
//!
//! ```sh
//! cargo run --release --example film                                 # writes film.gif
//! cargo run --release --example film -- 'frames/water_{}.bgeo'       # of files
//! ```

use limpid::frame::FrameInput;
use limpid::glam::{UVec2, Vec3};
use limpid::gpu::Gpu;
use limpid::liquid::Particles;
use limpid::offscreen::Offscreen;
use limpid_io::film::Film;
use limpid_io::input::Input;
use limpid_io::particles;

/// Frames of the wave, and frames per second.
const FRAMES: u32 = 12;
const FPS: f64 = 12.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = tempfile::tempdir()?;
    let source = match std::env::args().nth(1) {
        Some(source) => source.into(),
        None => {
            for frame in 1..=FRAMES {
                let path = folder.path().join(format!("wave_{frame}.ply"));
                particles::write(&Particles::from_positions(wave(frame)), &path)?;
            }
            folder.path().join("wave_{}.ply")
        }
    };
    // Radius, scene and camera come from the files where nothing says otherwise.
    let (loader, project) = Input::open(&source)?.resolve()?;
    let size = UVec2::new(480, 320);
    let mut offscreen = Offscreen::new(&Gpu::headless()?);
    let mut film = Film::create("film.gif".as_ref(), size, FPS)?;
    let mut camera = None;
    for frame in &loader.sequence.frames {
        let loaded = loader.load(frame, &project.scene)?;
        let camera = camera.get_or_insert_with(|| project.camera_for(loaded.bulk.bounds));
        let scene = loaded.scene(&project.scene);
        let input = FrameInput::new(&scene, &*camera, &loaded.splats, size);
        film.push(&offscreen.draw(input)?.picture)?;
    }
    film.finish()?;
    println!("film.gif: {} frames", loader.sequence.frames.len());
    Ok(())
}

/// A wave that runs through a block of liquid, y up, m.
fn wave(frame: u32) -> Vec<Vec3> {
    let phase = std::f32::consts::TAU * frame as f32 / FRAMES as f32;
    let points = (0..40 * 10 * 20)
        .map(|i| Vec3::new((i % 40) as f32, (i / 40 % 10) as f32, (i / 400) as f32));
    points.map(|p| 0.05 * (p + Vec3::Y * p.y / 10.0 * 2.5 * (0.314 * p.x - phase).sin())).collect()
}
