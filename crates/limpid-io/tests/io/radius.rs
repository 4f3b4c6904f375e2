//! The estimated radius of particles without radii: its error for lattices, packings, generated bodies,
//! simulations and sheets, in any unit, and its consistency within a sequence.

use std::path::Path;

use glam::{DVec3, Vec3};
use limpid::liquid::Particles;
use limpid::liquid::classify::estimate_radius;
use limpid_io::input::{FrameTime, Input, RadiusFrom};
use limpid_io::particles::{ReadOptions, Remark};
use limpid_io::project::Project;

use crate::support::Random;

/// The relative error that docs/radius.md guarantees.
const TOLERANCE: f64 = 0.05;

/// Positions of a lattice of `counts` cells of side `spacing`, with particles at `basis` in each.
fn lattice(counts: [i32; 3], spacing: f64, basis: &[[f64; 3]]) -> Vec<DVec3> {
    let [nx, ny, nz] = counts;
    let cells = (0..nx).flat_map(|x| (0..ny).flat_map(move |y| (0..nz).map(move |z| [x, y, z])));
    let places = cells.flat_map(|cell| {
        let corner = DVec3::from_array(cell.map(f64::from));
        basis.iter().map(move |&offset| spacing * (corner + DVec3::from_array(offset)))
    });
    places.collect()
}

fn jittered(mut places: Vec<DVec3>, by: f64, random: &mut Random) -> Vec<DVec3> {
    for place in &mut places {
        *place += DVec3::from_array([(); 3].map(|()| random.range(-by, by)));
    }
    places
}

/// Blue noise by dart throwing, scaled so that interior particles have the volume (2 r)³.
fn blue_noise(r: f64, random: &mut Random) -> Vec<DVec3> {
    const SIDE: f64 = 11.0;
    let mut places: Vec<DVec3> = Vec::new();
    for _ in 0..40_000 {
        let dart = DVec3::from_array([(); 3].map(|()| random.range(0.0, SIDE)));
        if places.iter().all(|place| place.distance_squared(dart) > 1.0) {
            places.push(dart);
        }
    }
    let inside = |x: &&DVec3| x.min_element() > 1.0 && x.max_element() < SIDE - 1.0;
    let density = places.iter().filter(inside).count() as f64 / (SIDE - 2.0).powi(3);
    places.iter().map(|&x| 2.0 * r * density.cbrt() * x).collect()
}

/// A lattice compressed by its weight: up to 3 % denser at the bottom.
fn compressed(r: f64, random: &mut Random) -> Vec<DVec3> {
    let places = jittered(lattice([14, 14, 14], 2.0 * r, &[[0.5; 3]]), 0.4 * r, random);
    let height = 28.0 * r;
    let squeeze = |y: f64| y - 0.03 * (y - 0.5 * y * y / height);
    places.into_iter().map(|x| x.with_y(squeeze(x.y))).collect()
}

/// A body and equally many particles of spray.
fn splashed(r: f64, random: &mut Random) -> Vec<DVec3> {
    let mut places = jittered(lattice([12, 12, 12], 2.0 * r, &[[0.5; 3]]), 0.4 * r, random);
    let spray = |random: &mut Random| [(); 3].map(|()| random.range(0.0, 200.0 * r));
    let drops: Vec<_> = (0..1728).map(|_| DVec3::from_array(spray(random))).collect();
    places.extend(drops);
    places
}

fn recipe(text: &str) -> (Vec<DVec3>, f64) {
    let project = Project::parse(&format!("[recipe]\n{text}\n"), "recipe", Path::new("."));
    let project = project.expect("a valid recipe");
    let recipe = project.source.recipe().expect("a recipe");
    let particles = recipe.particles().expect("particles");
    (particles.positions.iter().map(|x| x.as_dvec3()).collect(), recipe.particle_radius())
}

/// Sets of particles with known radii, m.
fn sets() -> Vec<(&'static str, Vec<DVec3>, f64)> {
    const HALF: f64 = 0.5;
    let random = &mut Random(1);
    let r = 0.025;
    let cubic = |counts| lattice(counts, 2.0 * r, &[[HALF; 3]]);
    // Touching spheres, each with twelve neighbours.
    let face_centred = [[0.0; 3], [0.0, HALF, HALF], [HALF, 0.0, HALF], [HALF, HALF, 0.0]];
    let mut sets = vec![
        ("cubic lattice", cubic([12; 3]), r),
        ("cubic, jittered by a tenth", jittered(cubic([12; 3]), 0.2 * r, random), r),
        ("cubic, jittered by a quarter", jittered(cubic([12; 3]), 0.5 * r, random), r),
        ("hexagonal packing", lattice([8; 3], 8f64.sqrt() * r, &face_centred), r),
        ("blue noise", blue_noise(r, random), r),
        ("compressed bottom", compressed(r, random), r),
        ("as much spray as body", splashed(r, random), r),
        ("sheet of one layer", jittered(cubic([40, 1, 40]), 0.1 * r, random), r),
        ("sheet of two layers", jittered(cubic([30, 2, 30]), 0.1 * r, random), r),
        ("sheet of three layers", jittered(cubic([24, 3, 24]), 0.1 * r, random), r),
    ];
    for (name, text) in [
        ("ball", "kind = \"ball\"\ncenter = [0.0, 0.0, 0.0]\nradius = 0.5\ncount = 5000"),
        ("slab", "kind = \"slab\"\nmin = [-1.0, 0.0, -1.0]\nmax = [1.0, 0.1, 1.0]\ncount = 8000"),
    ] {
        let (places, radius) = recipe(text);
        sets.push((name, places, radius));
    }
    // Simulated with SPlisHSPlasH at a radius of 0.025 m; the first frame is a lattice.
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .join("tests/data/double_dam_break");
    let mut files: Vec<_> =
        std::fs::read_dir(folder).expect("the frames").map(|file| file.unwrap().path()).collect();
    files.push(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../..")).join("sims/demo.bgeo"));
    for file in files.iter().filter(|file| file.extension().is_some_and(|e| e == "bgeo")) {
        let particles = limpid_io::particles::read(file).expect("a frame");
        let places = particles.positions.iter().map(|x| x.as_dvec3()).collect();
        sets.push(("double dam break", places, 0.025));
    }
    sets
}

/// The estimate is within 5 % for every set, in metres and in millimetres.
#[test]
fn estimates_are_within_five_percent() {
    let sets = sets();
    assert!(sets.len() >= 14, "{} sets", sets.len());
    let mut missed = Vec::new();
    for (name, places, radius) in sets {
        for unit in [1.0, 1e3] {
            let positions = places.iter().map(|&x| (unit * x).as_vec3()).collect();
            let guess = f64::from(estimate_radius(&Particles::from_positions(positions))) / unit;
            let error = guess / radius - 1.0;
            println!("{name}: {guess:.5} for {radius:.5}, {:+.1} %", 100.0 * error);
            if error.abs() > TOLERANCE {
                missed.push(format!("{name}: {guess} for {radius}"));
            }
        }
    }
    assert!(missed.is_empty(), "{missed:?}");
}

/// Duplicate particles do not change the estimate.
#[test]
fn coincident_particles_count_once() {
    let random = &mut Random(3);
    let places = jittered(lattice([10; 3], 0.05, &[[0.5; 3]]), 0.01, random);
    let once: Vec<Vec3> = places.iter().map(|x| x.as_vec3()).collect();
    let thrice = once.iter().flat_map(|&x| [x; 3]).collect();
    let [once, thrice] = [once, thrice].map(|x| estimate_radius(&Particles::from_positions(x)));
    assert_eq!(once, thrice);
    // So many coincident points that building a tree of all of them would take minutes.
    let crowd = vec![Vec3::ONE; 3_000_000];
    assert_eq!(estimate_radius(&Particles::from_positions(crowd)), 0.0);
}

/// A single frame has the same radius as in its sequence, that of the first frame, unless the frames are
/// from different simulations.
#[test]
fn a_single_frame_has_the_radius_of_its_sequence() {
    let folder = tempfile::tempdir().unwrap();
    let random = &mut Random(2);
    let path = |number: i32| folder.path().join(format!("w_{:03}.xyz", number + 1));
    let mut write = |number: i32, spacing: f64, shake: f64| {
        let places = lattice([8; 3], spacing, &[[0.5; 3]]);
        let places = jittered(places, shake * spacing, random);
        let particles = Particles::from_positions(places.iter().map(|x| x.as_vec3()).collect());
        limpid_io::particles::write(&particles, &path(number)).unwrap();
    };
    limpid_io::particles::write(&Particles::default(), &path(-1)).unwrap();
    // As at the start of an inlet: a single particle has no spacing.
    limpid_io::particles::write(&Particles::from_positions(vec![Vec3::ZERO]), &path(0)).unwrap();
    write(1, 0.05, 0.0);
    write(2, 0.05, 0.2);
    write(20, 0.08, 0.0);
    let resolved_radius = |input: &Path, number: i64| {
        let (input, project) = Input::open(input.to_str().unwrap()).unwrap().resolve().unwrap();
        let loaded = input.load(input.sequence.frame(number + 1).unwrap(), &project.scene).unwrap();
        assert_eq!(loaded.radius_from, RadiusFrom::Guess);
        loaded.splats.radius
    };
    let sequence = resolved_radius(folder.path(), 2);
    assert!((sequence - 0.025).abs() < 1e-6, "{sequence}");
    assert_eq!(resolved_radius(&path(2), 2), sequence);
    let other = resolved_radius(&path(20), 20);
    assert!((other - 0.04).abs() < 1e-6, "{other}");
}

/// The source of the radius is reported.
#[test]
fn the_source_of_a_radius_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let positions = vec![Vec3::ZERO, Vec3::X];
    let bare = Particles::from_positions(positions);
    let sized = Particles { radii: Some(vec![0.3; 2]), ..bare.clone() };
    let [bare, sized] = [("bare.bgeo", bare), ("sized.bgeo", sized)].map(|(name, particles)| {
        let path = folder.path().join(name);
        limpid_io::particles::write(&particles, &path).unwrap();
        path
    });
    let open = |path: &Path| Input::open(path.to_str().unwrap()).unwrap();
    let from = |input: Input| {
        let (input, project) = input.resolve().unwrap();
        let loaded = input.load(&input.sequence.frames[0], &project.scene).unwrap();
        (loaded.radius_from, loaded.splats.radius)
    };
    assert_eq!(from(open(&bare)), (RadiusFrom::Guess, 0.5));
    assert_eq!(from(open(&bare).with_radius(0.2).unwrap()), (RadiusFrom::Option, 0.2));
    assert_eq!(from(open(&sized).with_radius(0.2).unwrap()), (RadiusFrom::File, 0.3));
    // A given radius wins over one that the attribute map names, not over the file's own; both are said.
    let map = "radius=pscale/2".parse().unwrap();
    let options = ReadOptions { map, ..ReadOptions::default() };
    let mapped = || open(&sized).with_options(&options);
    assert_eq!(from(mapped()), (RadiusFrom::File, 0.15));
    assert_eq!(from(mapped().with_radius(0.2).unwrap()), (RadiusFrom::Option, 0.2));
    let remarks = |input: Input| input.loader.contents(FrameTime::at(0)).unwrap().remarks;
    let given = Remark::RadiusGiven { array: "pscale*0.5".into() };
    assert_eq!(remarks(mapped().with_radius(0.2).unwrap()), [given]);
    assert_eq!(remarks(open(&sized).with_radius(0.2).unwrap()), [Remark::OwnRadii]);
    assert_eq!(remarks(open(&sized)), []);
    let text = "[particles]\nsource = \"bare.bgeo\"\nradius = 0.4\n";
    std::fs::write(folder.path().join("scene.toml"), text).unwrap();
    assert_eq!(from(open(&folder.path().join("scene.toml"))), (RadiusFrom::Scene, 0.4));
}
