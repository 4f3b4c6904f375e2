//! Draws particles of a program's own in daylight.
//!
//! ```sh
//! cargo run --release --example picture      # writes picture.png
//! ```

use limpid::frame::FrameInput;
use limpid::glam::{UVec2, Vec3};
use limpid::gpu::Gpu;
use limpid::liquid::Particles;
use limpid::liquid::classify::classify;
use limpid::look::{Body, Framing, Look};
use limpid::offscreen::Offscreen;

/// Half of the distance between particles, m.
const RADIUS: f32 = 0.02;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let size = UVec2::new(640, 480);
    let particles = Particles::from_positions(drop_over_pool());
    let body = Body::new(&particles, RADIUS).ok_or("there are no particles")?;
    let scene = Look::Daylight.scene(&body);
    let camera = body.camera(Framing::of(size));
    let splats = classify(&particles, RADIUS, &scene.settings.classify);

    let mut offscreen = Offscreen::new(&Gpu::headless()?);
    let frame = offscreen.draw(FrameInput::new(&scene, &camera, &splats, size))?;
    frame.picture.save("picture.png")?;
    println!("picture.png: {} particles", particles.len());
    Ok(())
}

/// A drop above a pool, y up, m: a simulation has its particles in its place.
fn drop_over_pool() -> Vec<Vec3> {
    let lattice = |n: i32| {
        let axis = move || -n..=n;
        let points = axis().flat_map(move |x| axis().map(move |y| (x, y)));
        let points = points.flat_map(move |(x, y)| axis().map(move |z| (x, y, z)));
        points.map(|(x, y, z)| 2.0 * RADIUS * Vec3::new(x as f32, y as f32, z as f32))
    };
    let ripple = |p: Vec3| 0.2 + 0.04 * (14.0 * p.with_y(0.0).length()).cos();
    let pool = lattice(16).filter(|&p| p.y >= 0.0 && p.y < ripple(p));
    let drop = lattice(5).filter(|p| p.length() < 0.17).map(|p| p + Vec3::new(0.0, 0.55, 0.0));
    pool.chain(drop).collect()
}
