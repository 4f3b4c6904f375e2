//! Recipes: their particles match the parameters, are reproducible everywhere, and are distributed as in
//! a simulation; and all example scenes load.

use std::path::Path;

use glam::{DVec3, Vec3};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use limpid::liquid::classify;
use limpid::settings::Classify;
use limpid_io::Error;
use limpid_io::input::Input;
use limpid_io::project::{LiquidSource, Project};
use limpid_sim::recipe::Recipe;

const NAMES: [&str; 6] = ["drop", "slab", "idol", "breaker", "cascade", "vase"];

fn path(name: &str) -> String {
    format!("{}/sims/{name}.toml", concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

fn project(name: &str) -> Project {
    Project::load(Path::new(&path(name))).unwrap()
}

fn recipe(name: &str) -> Recipe {
    *project(name).source.recipe().expect("a recipe")
}

fn positions(recipe: &Recipe) -> Vec<DVec3> {
    recipe.particles().unwrap().positions.iter().map(|x| x.as_dvec3()).collect()
}

fn parse(table: &str) -> limpid_io::Result<Project> {
    Project::parse(table, "test", Path::new("."))
}

/// Each recipe opens as an input: one frame with a radius, a camera, and the requested number of
/// particles, with both kinds of splats where there is spray.
#[test]
fn every_recipe_is_an_input() {
    for name in NAMES {
        let (input, project) = Input::open(path(name)).unwrap().resolve().unwrap();
        let recipe = project.source.recipe().expect("a recipe");
        let [frame] = input.sequence.frames.as_slice() else { panic!("{name}: one frame") };
        let loaded = input.load(frame, &project.scene).unwrap();
        let share = loaded.particles as f64 / recipe.count();
        assert!((share - 1.0).abs() < 0.05, "{name}: {share} of the requested particles");
        assert_eq!(loaded.splats.radius, recipe.particle_radius() as f32);
        let splashes = loaded.splats.splashes.len();
        println!("{name}: {} particles, {splashes} splashes", loaded.particles);
        let spray = ["breaker", "cascade"].contains(&name);
        assert_eq!(splashes > loaded.particles / 1000, spray, "{name}: {splashes} splashes");
        assert!(loaded.splats.aggregates.len() > loaded.particles / 2, "{name}");
        if !spray {
            assert_eq!(splashes, 0, "{name}");
        }
    }
}

/// Particles are bit-identical on any number of threads, as the comparison of pictures from different
/// machines requires.
#[test]
fn particles_are_reproducible() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for name in NAMES {
        let recipe = recipe(name);
        let serial = pool.install(|| recipe.particles().unwrap());
        assert_eq!(serial, recipe.particles().unwrap(), "{name}");
    }
    let seeded = |seed: u32| {
        let Recipe::Ball { center, radius, count, .. } = recipe("drop") else { panic!("a ball") };
        Recipe::Ball { center, radius, count, seed }.particles().unwrap()
    };
    assert_ne!(seeded(0), seeded(1));
}

/// Particles are distributed as in a simulation: none are too close or isolated, they form neither a
/// lattice nor clumps, and the density inside is uniform and matches the spacing.
#[test]
fn particles_are_distributed_as_in_a_simulation() {
    for name in NAMES {
        let recipe = recipe(name);
        let (points, body) = (positions(&recipe), recipe.body());
        let spacing = 2.0 * recipe.particle_radius();
        let support = 2.0 * spacing;
        let table: Vec<[f64; 3]> = points.iter().map(DVec3::to_array).collect();
        let tree: ImmutableKdTree<f64, 3> = ImmutableKdTree::new_from_slice(&table).unwrap();
        let (mut nearest, mut shares, mut nearests) = (f64::INFINITY, Vec::new(), Vec::new());
        for x in &points {
            let mut density = 0.0;
            let mut own = f64::INFINITY;
            tree.query(&x.to_array())
                .within::<SquaredEuclidean<f64>>(support * support)
                .unsorted()
                .visit(|found| {
                    let q = found.distance.sqrt() / support;
                    density += 1.0 - q.powi(3);
                    // Excludes the particle itself, and those that coincide with it after rounding.
                    if found.distance > 0.0 {
                        own = own.min(found.distance.sqrt());
                    }
                });
            nearest = nearest.min(own);
            // Below the surface layer by more than the support.
            if body.distance(*x) < -1.5 * support {
                nearests.push(own);
                shares.push(density);
            }
        }
        // The sum of the weights over a cubic lattice of this spacing.
        let steps = || (-2..=2).map(f64::from);
        let lattice =
            steps().flat_map(|x| steps().flat_map(move |y| steps().map(move |z| (x, y, z))));
        let at_rest: f64 = lattice
            .map(|(x, y, z)| (1.0 - (DVec3::new(x, y, z).length() / 2.0).powi(3)).max(0.0))
            .sum();
        let mean = shares.iter().sum::<f64>() / shares.len() as f64 / at_rest;
        let variance = shares.iter().map(|d| (d / at_rest / mean - 1.0).powi(2)).sum::<f64>();
        let spread = (variance / shares.len() as f64).sqrt();
        let usual = nearests.iter().sum::<f64>() / nearests.len() as f64;
        println!(
            "{name}: nearest {:.2}, inside {:.2} spacings; density {mean:.3}, spread {spread:.3}",
            nearest / spacing,
            usual / spacing
        );
        assert!(nearest > 0.5 * spacing, "{name}: {} spacings", nearest / spacing);
        assert!((0.8..1.1).contains(&(usual / spacing)), "{name}: {} spacings", usual / spacing);
        assert!((mean - 1.0).abs() < 0.1 && spread < 0.08, "{name}: {mean}, {spread}");
        let variety = nearests.iter().map(|d| (d / usual - 1.0).powi(2)).sum::<f64>();
        let variety = (variety / nearests.len() as f64).sqrt();
        assert!(variety > 0.01, "{name}: a lattice, {variety}");
    }
}

/// Particles are at a depth of about r or more, the outermost layer at r: bodies are the ground truth
/// for surfaces.
#[test]
fn particles_are_inside_their_body() {
    for name in ["drop", "slab", "idol", "vase"] {
        let recipe = recipe(name);
        let (body, r) = (recipe.body(), recipe.particle_radius());
        let depths: Vec<f64> = positions(&recipe)
            .iter()
            .map(|&x| -body.distance(x) / body.gradient(x).length().max(0.5) / r)
            .collect();
        let least = depths.iter().copied().fold(f64::INFINITY, f64::min);
        let outermost = depths.iter().filter(|&&depth| depth < 1.05).count();
        println!("{name}: least depth {least:.2} r, {outermost} particles at r");
        assert!(least > 0.9, "{name}: {least}");
        assert!(outermost > depths.len() / 20, "{name}: {outermost}");
    }
    // The closed forms of a ball and a slab.
    let Recipe::Ball { center, radius, .. } = recipe("drop") else { panic!("a ball") };
    let ball = recipe("drop").body();
    let x = center + DVec3::new(0.3, -0.2, 0.9);
    assert!((ball.distance(x) - (x.distance(center) - radius)).abs() < 1e-12);
    assert!(ball.gradient(x).abs_diff_eq((x - center).normalize(), 1e-8));
    let Recipe::Slab { min, max, .. } = recipe("slab") else { panic!("a slab") };
    let slab = recipe("slab").body();
    assert!((slab.distance(max + DVec3::new(0.03, 0.04, 0.0)) - 0.05).abs() < 1e-12);
    assert!((slab.volume() / (max - min).element_product() - 1.0).abs() < 0.01);
}

/// A vase matches its parameters: the volume by integrals of the profile, the radii at foot, belly and
/// neck, and a surface that is level at the centre, with ripples of the given wavelength.
#[test]
fn a_vase_matches_its_parameters() {
    let Recipe::Vase(vase) = recipe("vase") else { panic!("a vase") };
    let body = recipe("vase").body();
    let [foot, belly, neck] = vase.radii;
    // π ∫ r² dy, where r = a + (b − a)(3 u² − 2 u³) from foot to belly and from belly to neck.
    let part = |a: f64, b: f64| a * b + 13.0 / 35.0 * (b - a) * (b - a);
    let mean = 0.4 * part(foot, belly) + 0.6 * part(belly, neck);
    let volume = std::f64::consts::PI * vase.height * mean;
    let share = body.volume() / volume;
    println!("volume {share:.4} of the closed form");
    assert!((share - 1.0).abs() < 0.01, "{share}");

    // Bisects for the sign change of the distance along a line, from inside to outside.
    let end = |from: DVec3, way: DVec3| {
        let (mut inside, mut outside) = (0.0, 1.0);
        for _ in 0..50 {
            let middle = 0.5 * (inside + outside);
            if body.distance(from + middle * way) < 0.0 {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    };
    for (share, radius) in [(1e-6, foot), (0.4, belly), (0.97, neck)] {
        let from = vase.base + share * vase.height * DVec3::Y;
        for way in [DVec3::X, DVec3::new(-0.6, 0.0, 0.8)] {
            let found = end(from, way);
            assert!((found - radius).abs() < 0.003 * belly, "at {share}: {found}, not {radius}");
        }
    }
    let surface = |radius: f64| {
        let from = vase.base + DVec3::new(radius, 0.9 * vase.height, 0.0);
        0.9 * vase.height + end(from, DVec3::Y) - vase.height
    };
    assert!((surface(0.0) - vase.ripple).abs() < 1e-9, "{}", surface(0.0));
    let slope = (surface(1e-4) - surface(0.0)) / 1e-4;
    assert!(slope.abs() < 0.02, "slope {slope} in the middle");
    assert!(surface(0.5 * vase.wavelength) < -0.3 * vase.ripple);
    assert!(surface(vase.wavelength) > 0.3 * vase.ripple);
}

/// A reef is lit only if its file says so, so that older scenes look the same.
#[test]
fn a_reef_is_lit_on_request() {
    for name in ["reef", "lagoon"] {
        let lit = name == "lagoon";
        let reef = recipe(name).solids();
        assert!(!reef.is_empty() && reef.iter().all(|solid| solid.lit == lit), "{name}");
    }
}

/// Every example scene loads with values in range, a camera, and lit solids exactly if it has lights.
#[test]
fn every_example_scene_loads() {
    let folder = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/sims");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let name = path.to_str().unwrap();
        let mut project = Project::load(&path).unwrap();
        if project.source.simulation().is_none() {
            let input;
            (input, project) = Input::open(name).unwrap().resolve().unwrap();
            assert_eq!(input.sequence.frames.len(), 1, "{name}");
            assert!(project.source != LiquidSource::Unspecified, "{name}");
        }
        assert!(project.camera.is_some(), "{name}");
        let scene = project.scene;
        let lit = scene.solids.iter().any(|solid| solid.lit);
        assert_eq!(lit, !scene.lights.is_empty(), "{name}: lit solids and lights");
        count += 1;
    }
    assert!(count >= 18, "{count} scenes");
}

/// No particle is inside a solid, although droplets and sheets may leave the body.
#[test]
fn no_particle_is_in_a_solid() {
    for name in NAMES {
        let project = project(name);
        let recipe = project.source.recipe().expect("a recipe");
        let r = recipe.particle_radius();
        for x in recipe.particles().unwrap().positions {
            for solid in &project.scene.solids {
                let distance = solid.shape.distance(x.as_dvec3()).0;
                assert!(distance > 0.4 * r, "{name}: {x} is {} r from a solid", distance / r);
            }
        }
    }
}

/// The drawn surface, as the extent of the splats along the normals of a ball, is within half a particle
/// radius of the body's. It is slightly too low, since smoothing moves the centres inwards.
#[test]
fn splats_reach_the_surface() {
    let recipe = recipe("drop");
    let Recipe::Ball { center, radius, .. } = recipe else { panic!("a ball") };
    let r = recipe.particle_radius();
    let particles = recipe.particles().unwrap();
    let splats = classify::classify(&particles, r as f32, &Classify::default());
    // Rays from the centre, to the farthest point of any splat.
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    let count = 400;
    let mut total = 0.0;
    for i in 0..count {
        let y = 1.0 - (2 * i + 1) as f64 / count as f64;
        let around = golden * i as f64;
        let ring = (1.0 - y * y).sqrt();
        let way = DVec3::new(ring * around.cos(), y, ring * around.sin());
        let reach = splats.aggregates.iter().filter_map(|splat| {
            let offset = Vec3::from_array(splat.centre).as_dvec3() - center;
            if offset.dot(way) < 0.8 * radius || offset.cross(way).length() > 3.0 * r {
                return None;
            }
            let [xx, yy, zz] = splat.diagonal.map(f64::from);
            let [xy, xz, yz] = splat.off_diagonal.map(f64::from);
            let unit = glam::DMat3::from_cols(
                DVec3::new(xx, xy, xz),
                DVec3::new(xy, yy, yz),
                DVec3::new(xz, yz, zz),
            )
            .inverse();
            let (d, o) = (unit * way, unit * offset);
            let b = d.dot(o) / d.length_squared();
            let beside = 1.0 - (o - b * d).length_squared();
            (beside >= 0.0).then(|| b + (beside / d.length_squared()).sqrt())
        });
        total += reach.fold(0.0, f64::max) - radius;
    }
    let offset = total / f64::from(count) / r;
    println!("drawn surface {offset:.2} r outside the ball");
    assert!((-0.5..0.2).contains(&offset), "{offset} r");
}

/// Values out of range are errors that name the key, without a panic or a large allocation.
#[test]
fn errors_of_bad_recipes_name_the_key() {
    let ball = "center = [0.0, 0.0, 0.0]\n";
    let vase = "base = [0.0, 0.0, 0.0]\nheight = 0.3\nradii = [0.07, 0.12, 0.09]\n\
                ripple = 0.003\nwavelength = 0.04\n";
    let pool = "half_extent = [2.0, 2.0]\ndepth = 1.0\nhull = 0.1\ncount = 100\n\
                waves = { count = 1, wavelengths = [0.5, 1.0], rms_slope = 0.05 }\n";
    let wave = "length = 3.0\nwidth = 1.0\ndepth = 0.2\nheight = 0.5\nspray = 0.0\n";
    let cases = [
        (format!("kind = \"ball\"\n{ball}radius = 0.0\ncount = 100"), "radius"),
        (format!("kind = \"ball\"\n{ball}radius = nan\ncount = 100"), "radius"),
        (format!("kind = \"ball\"\n{ball}radius = 1.0\ncount = 1000000000000"), "count"),
        (format!("kind = \"ball\"\n{ball}radius = 1.0\ncount = 1e12"), "count"),
        (format!("kind = \"ball\"\n{ball}radius = 1.0\ncount = -5"), "count"),
        (format!("kind = \"ball\"\n{ball}radius = 1.0\ncount = nan"), "count"),
        (format!("kind = \"ball\"\n{ball}radius = 1.0"), "count"),
        (format!("kind = \"ball\"\n{ball}radius = 1.0\ncount = 9\nradios = 1.0"), "radios"),
        (format!("kind = \"ball\"\n{ball}radius = 1.0\ncount = 9\nradios = 1.0"), "`radius`"),
        (format!("kind = \"bell\"\n{ball}radius = 1.0\ncount = 100"), "`ball`"),
        ("kind = \"ball\"\ncenter = [inf, 0.0, 0.0]\nradius = 1.0\ncount = 99".into(), "center"),
        ("kind = \"ball\"\ncenter = [0.0, nan, 0.0]\nradius = 1.0\ncount = 99".into(), "center"),
        ("kind = \"slab\"\nmin = [0, 0, 0]\nmax = [1, -1, 1]\ncount = 100".into(), "min"),
        ("kind = \"slab\"\nmin = [0, 0, 0]\nmax = [1, nan, 1]\ncount = 100".into(), "max"),
        ("kind = \"idol\"\nbase = [0, 0, 0]\nheight = -1.0\ncount = 100".into(), "height"),
        (format!("kind = \"breaker\"\n{wave}count = 0"), "count"),
        (format!("kind = \"breaker\"\n{}count = 100", wave.replace("0.0", "0.9")), "spray"),
        (format!("kind = \"breaker\"\n{}count = 100", wave.replace("0.2", "0.0")), "depth"),
        (format!("kind = \"breaker\"\n{wave}count = 100\nhight = 1.0"), "`height`"),
        (format!("kind = \"vase\"\n{vase}count = 0"), "count"),
        (format!("kind = \"vase\"\n{}count = 100", vase.replace("0.3", "nan")), "height"),
        (format!("kind = \"vase\"\n{}count = 100", vase.replace("0.12", "0.06")), "radii"),
        (format!("kind = \"vase\"\n{}count = 100", vase.replace("0.07", "0.0")), "radii"),
        (format!("kind = \"vase\"\n{}count = 100", vase.replace("0.003", "0.1")), "ripple"),
        (format!("kind = \"vase\"\n{}count = 100", vase.replace("0.04", "0.01")), "wavelength"),
        (format!("kind = \"vase\"\n{}count = 100", vase.replace("[0.0,", "[inf,")), "base"),
        (format!("kind = \"vase\"\n{vase}count = 100\nripples = 1"), "`ripple`"),
        (format!("kind = \"pool\"\n{pool}reef = {{ blades = 0, bumps = 1, lid = true }}"), "`lit`"),
    ];
    for (table, key) in cases {
        let error = parse(&format!("[recipe]\n{table}\n")).unwrap_err();
        assert!(matches!(error, Error::Scene { .. }), "{table}: {error}");
        assert!(error.to_string().contains(key), "{table}: {error}");
    }
    let both = "[particles]\nsource = \"a.ply\"\n[recipe]\nkind = \"ball\"\ncenter = [0, 0, 0]\n\
                radius = 1.0\ncount = 100\n";
    assert!(parse(both).unwrap_err().to_string().contains("[recipe]"));
}

/// Extreme but allowed values, with few particles or odd proportions, quickly give finite particles
/// or an error.
#[test]
fn extreme_recipes_give_finite_particles_or_errors() {
    let tables = [
        "kind = \"ball\"\ncenter = [9000, 0, 0]\nradius = 0.5\ncount = 10",
        "kind = \"slab\"\nmin = [0, 0, 0]\nmax = [100, 0.001, 0.1]\ncount = 1000",
        "kind = \"breaker\"\nlength = 0.001\nwidth = 1000\ndepth = 0.001\nheight = 10\nspray = 0.5\ncount = 500",
        "kind = \"cascade\"\nsteps = 100\ntread = 0.001\nriser = 10\nwidth = 1\nfilm = 0.001\n\
         speed = 1000\nbasin = [1, 1, 0.001]\nspray = 0.5\ncount = 500",
        "kind = \"cascade\"\nsteps = 1\ntread = 10\nriser = 0.001\nwidth = 1000\nfilm = 1\n\
         speed = 0.001\nbasin = [0.001, 0.001, 0.001]\nspray = 0.1\ncount = 500",
        "kind = \"vase\"\nbase = [9000, 0, 0]\nheight = 0.001\nradii = [0.001, 1000, 0.001]\n\
         ripple = 0.0001\nwavelength = 0.001\ncount = 500",
        "kind = \"vase\"\nbase = [0, 0, 0]\nheight = 1000\nradii = [0.001, 0.001, 0.001]\n\
         ripple = 100\nwavelength = 1000\ncount = 500",
    ];
    for table in tables {
        let project = parse(&format!("[recipe]\n{table}\n")).unwrap();
        match project.source.recipe().expect("a recipe").particles() {
            Ok(particles) => {
                assert!(particles.positions.iter().all(|x| x.is_finite()), "{table}");
                assert!(particles.len() < 10_000, "{table}: {}", particles.len());
            }
            Err(error) => {
                let message = error.to_string();
                let expected = ["too thin", "too far"].iter().any(|part| message.contains(part));
                assert!(expected, "{table}: {message}");
            }
        }
    }
}
