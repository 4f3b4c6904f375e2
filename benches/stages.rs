//! `cargo bench --bench stages`: CPU stages of a frame, with criterion's statistics.
//!
//! - `read`: each format, 125,000 particles, with velocities if the format has them, from a hot
//!   cache;
//! - `neighbours`: the neighbour search and the sums over neighbours;
//! - `classify`: the same, and the ellipsoids computed from the sums;
//! - `tree`: as `classify`, with kiddo's tree instead of the grid;
//! - `device`: as `classify`, on the graphics device, including readback.
//!
//! `cargo bench --bench stages -- classify/40000` runs the benches whose names contain it, and `--
//! --save-baseline NAME` and `-- --baseline NAME` compare two versions of the code.

mod support;

use std::hint::black_box;
use std::time::Duration;

use criterion::{
    BenchmarkId, Criterion, SamplingMode, Throughput, criterion_group, criterion_main,
};
use limpid::gpu::Gpu;
use limpid::liquid::classify::{Classifier, Cloud};
use limpid::liquid::{Ellipsoid, Particles};

use support::{COUNTS, Swell};

/// One format per reader, and further ones where a reader has several code paths.
const FORMATS: [&str; 11] =
    ["xyz", "npy", "npz", "bhclassic", "bgeo.gz", "vtk", "vtu", "ply", "csv", "pos", "shaped.pos"];

fn read(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let liquid = Swell::new(COUNTS[2]).expect("a frame of the swell");
    let full = liquid.particles;
    let bare = Particles::from_positions(full.positions.clone());
    let mut group = criterion.benchmark_group("read");
    group.throughput(Throughput::Elements(full.len() as u64));
    for format in FORMATS {
        let particles = match format {
            "xyz" | "npy" | "pos" => bare.clone(),
            "shaped.pos" => Particles {
                radii: Some(vec![liquid.radius; full.len()]),
                ellipsoids: Some(vec![Ellipsoid { xx: 1.5, ..Ellipsoid::SPHERE }; full.len()]),
                ..bare.clone()
            },
            _ => full.clone(),
        };
        let path = folder.path().join(format!("liquid.{format}"));
        limpid_io::particles::write(&particles, &path).expect("the format holds the particles");
        group.bench_function(format, |bencher| {
            bencher.iter(|| {
                black_box(limpid_io::particles::read(&path).expect("it was written before"))
            });
        });
    }
    group.finish();
}

fn classification(criterion: &mut Criterion) {
    let device = Gpu::headless().and_then(|gpu| Classifier::new(&gpu));
    if let Err(problem) = &device {
        eprintln!("no rows of the device: {problem}");
    }
    for name in ["neighbours", "classify", "tree", "device"] {
        if name == "device" && device.is_err() {
            continue;
        }
        let mut group = criterion.benchmark_group(name);
        group.sampling_mode(SamplingMode::Flat).sample_size(10);
        group.warm_up_time(Duration::from_secs(1));
        for count in COUNTS {
            let Swell { project, particles, radius } =
                Swell::new(count).expect("a frame of the swell");
            let mut settings = project.scene.settings.classify;
            if name == "neighbours" {
                // Below this density everything is a splash, which needs only its neighbours.
                settings.splash_density = f32::INFINITY;
            }
            group.throughput(Throughput::Elements(particles.len() as u64));
            group.bench_function(BenchmarkId::from_parameter(count), |bencher| {
                bencher.iter(|| {
                    let cloud = Cloud::new(&particles, radius);
                    black_box(match (name, &device) {
                        ("tree", _) => cloud.classify_by_tree(&settings),
                        ("device", Ok(device)) => {
                            device.classify_cloud(&cloud, &settings).expect("the device works")
                        }
                        _ => cloud.classify(&settings),
                    })
                });
            });
        }
        group.finish();
    }
}

criterion_group!(stages, read, classification);
criterion_main!(stages);
