//! `cargo bench --bench meshes`: what triangles cost. Frames of `sims/cascade.toml` in which a solid is a
//! mesh, against the same frames with a box in its place, by turns:
//!
//! - `step`: the third step, in plain colour, as a box of triangles: the same picture;
//! - `ball`: a ball with bumps in the basin, against the box around it;
//! - `million`: the step as a million triangles, and the time that its tree takes.
//!
//! ```text
//! cargo bench --bench meshes                              all of them, 100,000 triangles but for the last
//! cargo bench --bench meshes -- step frames=21 size=640x480 refract.samples=4
//! ```

#[path = "support/options.rs"]
mod options;

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::{DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::frame::FrameInput;
use limpid::gpu::{Gpu, PassTime};
use limpid::liquid::classify::Splats;
use limpid::mesh::{Mesh, MeshData, Placement};
use limpid::offscreen::Offscreen;
use limpid::scene::{Scene, Shape, Solid, Surface};
use limpid_io::input::{Input, Loader};
use limpid_io::project::Project;

use options::Options;

/// Names of the scenes that are compared, in this order.
const ALL: [&str; 3] = ["step", "ball", "million"];

fn main() -> limpid_io::Result<()> {
    let options = Options::parse(&ALL, 9);
    let gpu = Gpu::headless()?;
    let Options { size, frames, .. } = options;
    println!("{}, {}x{}, {frames} pairs of frames", gpu.adapter(), size.x, size.y);
    for name in &options.chosen {
        compare(&gpu, name, &options)?;
    }
    Ok(())
}

/// Measures a scene with a mesh against the one with a box.
fn compare(gpu: &Gpu, name: &str, options: &Options) -> limpid_io::Result<()> {
    /// The step of the scene that is replaced.
    const STEP: usize = 2;
    let repository = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let file = repository.join("sims/cascade.toml");
    let open = || -> limpid_io::Result<_> {
        let (input, mut project) = Input::open(&file)?.resolve()?;
        project.set(&options.settings)?;
        Ok((input, project))
    };
    let (_, project) = open()?;
    let (min, max) = match project.scene.solids[STEP].shape {
        Shape::Box { min, max } if name != "ball" => (min, max),
        _ => (DVec3::new(1.6, 0.02, -0.2), DVec3::new(2.0, 0.42, 0.2)),
    };
    let data = match name {
        "step" => tessellated(min, max, 92),
        "ball" => bumpy(0.5 * (min + max), 0.5 * (max - min).x, 224),
        "million" => tessellated(min, max, 289),
        _ => panic!("{name} is none of step, ball and million"),
    };
    let start = Instant::now();
    let mesh = Arc::new(Mesh::new(data).expect("a mesh"));
    let built = start.elapsed().as_secs_f64();
    println!(
        "\n{name}, {} triangles, checked and in a tree after {built:.2} s",
        mesh.triangles().len()
    );

    let subject = |shape: Shape| -> limpid_io::Result<Subject> {
        let (input, mut project) = open()?;
        let solid = Solid { shape, surface: Surface::Color(Vec3::splat(0.6)), lit: true };
        match name {
            "ball" => project.scene.solids.push(solid),
            _ => project.scene.solids[STEP] = solid,
        }
        Subject::load(&input, project)
    };
    let boxed = subject(Shape::Box { min, max })?;
    let meshed = subject(Shape::Mesh { mesh, placement: Placement::default() })?;
    let mut drawn = [&boxed, &meshed].map(|subject| Drawn::new(gpu, subject, options.size));
    // The first frames compile shaders and upload.
    for drawn in &mut drawn {
        let (ms, _) = drawn.frame()?;
        println!("{:>16} {ms:9.1} ms, shaders compiled and meshes uploaded", "first frame");
    }
    let mut times = [Vec::new(), Vec::new()];
    let mut pictures = [Vec::new(), Vec::new()];
    for i in 0..options.frames {
        // Turn about, so that neither is always the one that comes second.
        for which in if i % 2 == 0 { [0, 1] } else { [1, 0] } {
            let (ms, pixels) = drawn[which].frame()?;
            times[which].push(ms);
            pictures[which] = pixels;
        }
    }
    passes(&mut drawn)?;
    let ratios: Vec<f64> =
        times[1].iter().zip(&times[0]).map(|(mesh, boxed)| mesh / boxed).collect();
    for (what, ms) in ["with a box", "with the mesh"].iter().zip(&times) {
        let [_, low, middle, high, _] = quartiles(ms);
        println!("{what:>16} {middle:9.1} ms, quartiles {low:.1} to {high:.1}");
    }
    let [_, low, middle, high, _] = quartiles(&ratios);
    println!("{:>16} {middle:9.3}    quartiles {low:.3} to {high:.3}", "mesh / box");
    let apart = pictures[0].iter().zip(&pictures[1]).filter(|(a, b)| a.abs_diff(**b) > 2).count();
    println!(
        "{:>16} {:9.4} of the bytes by more than 2",
        "pictures differ",
        apart as f64 / pictures[0].len() as f64
    );
    Ok(())
}

/// Prints the passes that take different times, by the device's timestamps: medians of three frames.
fn passes(drawn: &mut [Drawn<'_>; 2]) -> limpid_io::Result<()> {
    let mut times: [Vec<(&str, Vec<f64>)>; 2] = Default::default();
    for (drawn, times) in drawn.iter_mut().zip(&mut times) {
        for _ in 0..3 {
            for (i, pass) in drawn.timed()?.into_iter().enumerate() {
                if times.len() == i {
                    times.push((pass.name, Vec::new()));
                }
                times[i].1.push(pass.ms);
            }
        }
    }
    let [boxed, meshed] = times;
    for ((name, boxed), (_, meshed)) in boxed.iter().zip(&meshed) {
        let [before, after] = [boxed, meshed].map(|ms| quartiles(ms)[2]);
        if after > 1.1 * before + 1.0 {
            println!("{name:>16} {after:9.1} ms, with the box {before:.1}");
        }
    }
    Ok(())
}

/// A frame to render.
struct Subject {
    scene: Scene,
    camera: Camera,
    splats: Splats,
}

impl Subject {
    fn load(input: &Loader, project: Project) -> limpid_io::Result<Self> {
        let loaded = input.load(&input.sequence.frames[0], &project.scene)?;
        let camera = project.camera_for(loaded.bulk.bounds);
        Ok(Self { scene: project.scene, camera, splats: loaded.splats })
    }
}

/// A subject with a renderer of its own.
struct Drawn<'a> {
    subject: &'a Subject,
    offscreen: Offscreen,
    size: UVec2,
}

impl<'a> Drawn<'a> {
    fn new(gpu: &Gpu, subject: &'a Subject, size: UVec2) -> Self {
        Self { subject, offscreen: Offscreen::new(gpu), size }
    }

    /// The times of the passes.
    fn timed(&mut self) -> limpid_io::Result<Vec<PassTime>> {
        let Subject { scene, camera, splats } = self.subject;
        let input = FrameInput::new(scene, camera, splats, self.size);
        let frame = self.offscreen.draw(FrameInput { timing: true, ..input })?;
        Ok(frame.passes)
    }

    /// Draws everything anew: the time until the picture is in host memory, ms, and its bytes.
    fn frame(&mut self) -> limpid_io::Result<(f64, Vec<u8>)> {
        let Subject { scene, camera, splats } = self.subject;
        let start = Instant::now();
        let frame = self.offscreen.draw(FrameInput::new(scene, camera, splats, self.size))?;
        Ok((start.elapsed().as_secs_f64() * 1e3, frame.picture.into_raw()))
    }
}

/// A closed box of `12 n²` triangles.
fn tessellated(min: DVec3, max: DVec3, n: u32) -> MeshData {
    let mut data = MeshData::default();
    // Faces share the places of their edges, since a coordinate depends on its own index alone.
    let place = |at: [u32; 3]| {
        let along =
            |axis: usize| min[axis] + (max - min)[axis] * f64::from(at[axis]) / f64::from(n);
        DVec3::new(along(0), along(1), along(2))
    };
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for side in [0, n] {
            let first = data.positions.len() as u32;
            for j in 0..=n {
                for i in 0..=n {
                    let mut at = [side; 3];
                    (at[u], at[v]) = (i, j);
                    data.positions.push(place(at));
                }
            }
            for (j, i) in (0..n).flat_map(|j| (0..n).map(move |i| (j, i))) {
                let corner = |di: u32, dj: u32| first + (j + dj) * (n + 1) + i + di;
                let (a, b, c, d) = (corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1));
                let outwards = [[a, b, c], [a, c, d]];
                data.triangles
                    .extend(outwards.map(|t| if side == 0 { [t[0], t[2], t[1]] } else { t }));
            }
        }
    }
    data
}

/// A closed ball of about `2 n²` triangles with bumps that stay within the radius.
fn bumpy(center: DVec3, radius: f64, n: u32) -> MeshData {
    let mut data = MeshData::default();
    for j in 0..=n {
        let (height, round) = (std::f64::consts::PI * f64::from(j) / f64::from(n)).sin_cos();
        // The poles are one place each, exactly.
        let height = if j == 0 || j == n { 0.0 } else { height };
        for i in 0..n {
            let longitude = std::f64::consts::TAU * f64::from(i) / f64::from(n);
            let bump = 0.95 + 0.05 * height * (12.0 * longitude).sin() * (9.0 * round).sin();
            let towards = DVec3::new(height * longitude.cos(), round, height * longitude.sin());
            data.positions.push(center + radius * bump * towards);
        }
    }
    for (j, i) in (0..n).flat_map(|j| (0..n).map(move |i| (j, i))) {
        let at = |di: u32, dj: u32| (j + dj) * n + (i + di) % n;
        data.triangles.extend([[at(0, 0), at(1, 0), at(1, 1)], [at(0, 0), at(1, 1), at(0, 1)]]);
    }
    data
}

/// Least, quartiles and greatest.
fn quartiles(all: &[f64]) -> [f64; 5] {
    let mut all = all.to_vec();
    all.sort_by(f64::total_cmp);
    [0.0, 0.25, 0.5, 0.75, 1.0].map(|share| all[(share * (all.len() - 1) as f64).round() as usize])
}
