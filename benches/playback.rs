//! `cargo bench --bench playback`: frames per second at which a frame cache reads and classifies
//! ahead of playback, and its memory, with 1, 2, 4, … threads up to this machine's.
//!
//! The sequences are the scenes `cascade` (40,000 particles) and `breaker` (125,000), each written
//! as gzip BGEO with ids, velocities and densities, as simulators write them. Files are read from a
//! hot cache. Each figure is the median of three runs.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use limpid::liquid::Particles;
use limpid_io::frame_cache::FrameCache;
use limpid_io::input::Input;

const FRAMES: usize = 24;
const BUDGET: u64 = 64 << 20;
const RUNS: usize = 3;
/// The environment variable that makes a child process measure the sequence in this folder.
const FOLDER: &str = "LIMPID_BENCH_FOLDER";

fn main() -> limpid_io::Result<()> {
    if let Some(folder) = std::env::var_os(FOLDER) {
        return measure(Path::new(&folder));
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let program = std::env::current_exe().expect("this program has a path");
    println!("{cores} cores, budget {} MiB", BUDGET >> 20);
    for name in ["cascade", "breaker"] {
        let folder = tempfile::tempdir().expect("a temporary folder");
        write(name, folder.path())?;
        for threads in (0..).map(|k| 1 << k).take_while(|&threads| threads <= cores) {
            let run = Command::new(&program)
                .env(FOLDER, folder.path())
                .env("RAYON_NUM_THREADS", threads.to_string())
                .status();
            assert!(run.is_ok_and(|status| status.success()), "the measuring run failed");
        }
    }
    Ok(())
}

/// Writes [`FRAMES`] frames of a recipe's particles.
fn write(name: &str, folder: &Path) -> limpid_io::Result<()> {
    let scene =
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join(format!("sims/{name}.toml"));
    let loader = Input::open(scene)?.loader;
    let bare = loader.particles(&loader.sequence.frames[0])?;
    let count = bare.len();
    let particles = Particles {
        velocities: Some(bare.positions.iter().map(|x| 0.1 * *x).collect()),
        densities: Some(vec![1000.0; count]),
        ids: Some((0..count as i64).collect()),
        ..bare
    };
    (0..FRAMES).try_for_each(|i| {
        limpid_io::particles::write(&particles, &folder.join(format!("{name}_{i:04}.bgeo")))
    })
}

fn measure(folder: &Path) -> limpid_io::Result<()> {
    let (input, project) = Input::open(folder)?.resolve()?;
    let numbers: Vec<i64> = input.sequence.frames.iter().map(|frame| frame.number).collect();
    let frame_times = input.frame_times(&numbers, 1.0);
    let threads = rayon::current_num_threads();
    let mut rates = Vec::new();
    let (mut particles, mut peak) = (0, 0);
    for _ in 0..RUNS {
        let (input, scene, frame_times) =
            (input.clone(), project.scene.clone(), frame_times.clone());
        let load = move |i: usize| input.load(frame_times[i], &scene);
        let start = Instant::now();
        let cache = FrameCache::new(numbers.len(), BUDGET, threads, load, |_| ());
        for i in 0..numbers.len() {
            cache.aim(i, 1, false);
            particles = cache.wait(i)?.particles;
        }
        rates.push(numbers.len() as f64 / start.elapsed().as_secs_f64());
        peak = cache.state().most;
    }
    rates.sort_by(f64::total_cmp);
    let (least, median, greatest) = (rates[0], rates[RUNS / 2], rates[RUNS - 1]);
    println!(
        "{particles:>7} particles, {threads} threads: {median:.1} frames/s ({least:.1} to \
         {greatest:.1}), at most {:.1} MiB",
        peak as f64 / f64::from(1 << 20)
    );
    Ok(())
}
