//! Recipes and simulations with extreme numbers: they are generated, or refused by an error that names a
//! key, with time and memory in proportion to their particles, not to the extent of empty space.

use std::path::Path;

use limpid_io::Error;
use limpid_io::bake::Bake;
use limpid_io::project::Project;

use super::damage::{Random, counting, within};

const RECIPES: [&str; 7] = [
    "kind = \"ball\"\ncenter = [0.0, 0.5, 0.0]\nradius = 0.4\ncount = 300\n",
    "kind = \"slab\"\nmin = [-0.5, 0.0, -0.5]\nmax = [0.5, 0.4, 0.5]\ncount = 300\n",
    "kind = \"idol\"\nbase = [0.0, 0.0, 0.0]\nheight = 1.0\ncount = 300\n",
    "kind = \"pool\"\nhalf_extent = [1.0, 1.0]\ndepth = 0.5\nhull = 0.2\ncount = 300\n\
     waves = { count = 20, wavelengths = [0.5, 1.5], rms_slope = 0.05, seed = 1 }\n",
    "kind = \"vase\"\nbase = [0.0, 0.0, 0.0]\nheight = 1.0\nradii = [0.2, 0.4, 0.3]\nripple = 0.01\n\
     wavelength = 0.2\ncount = 300\n",
    "kind = \"cascade\"\nsteps = 3\ntread = 0.6\nriser = 0.3\nwidth = 1.0\nfilm = 0.1\nspeed = 1.0\n\
     basin = [2.0, 2.0, 0.5]\nspray = 0.1\ncount = 300\n",
    "kind = \"slab\"\nmin = [-1e4, 0.0, -1e4]\nmax = [1e4, 0.5, 1e4]\ncount = 300\n",
];

const SIMULATIONS: [&str; 4] = [
    "frames = 9\nradius = 0.05\n[[simulation.block]]\nmin = [0.0, 0.0, 0.0]\nmax = [0.5, 0.5, 0.5]\n",
    "frames = 9\nradius = 0.05\n[[simulation.block]]\ncenter = [0.0, 1.0, 0.0]\nradius = 0.3\n",
    "frames = 9\nradius = 0.05\n[[simulation.emitter]]\ncenter = [0.0, 1.0, 0.0]\n\
     direction = [0.0, -1.0, 0.0]\nradius = 0.3\nspeed = 2.0\nfrom = 0.0\n",
    "kind = \"swell\"\nframes = 9\nradius = 0.05\n\
     waves = { count = 10, wavelengths = [0.5, 2.0], rms_slope = 0.02, seed = 1 }\n\
     [[simulation.block]]\nmin = [0.0, 0.0, 0.0]\nmax = [1.0, 0.3, 0.5]\n",
];

/// Values so small or so large that almost no particles are generated, or far too many.
const NUMBERS: [&str; 12] =
    ["0.0", "-1.0", "1e-300", "1e-9", "1e-6", "1e-3", "1e3", "1e4", "1e9", "1e300", "inf", "nan"];

/// Replaces some decimal numbers of a text. Integers, which are counts of particles, are kept.
fn mutated(text: &str, random: &mut Random) -> String {
    let mut text = text.to_owned();
    for _ in 0..=random.below(3) {
        let decimal = |(at, _): &(usize, &str)| text[..*at].ends_with(|c: char| c.is_ascii_digit());
        let points: Vec<usize> =
            text.match_indices('.').filter(decimal).map(|(at, _)| at).collect();
        let Some(&point) = points.get(random.below(points.len())) else { return text };
        let in_number = |c: char| c.is_ascii_digit() || c == '-';
        let start = text[..point].rfind(|c| !in_number(c)).map_or(0, |at| at + 1);
        let after = &text[point + 1..];
        let end = point + 1 + after.find(|c: char| !c.is_ascii_digit()).unwrap_or(after.len());
        // Numbers with an exponent are kept.
        if !after[end - point - 1..].starts_with('e') {
            text.replace_range(start..end, NUMBERS[random.below(NUMBERS.len())]);
        }
    }
    text
}

/// Fails unless the error is a usage error of one line.
#[track_caller]
fn refused(text: &str, error: &Error) {
    let message = error.to_string();
    assert_eq!(error.category() as u8, 2, "{message}\n{text}");
    assert!(!message.contains('\n') && message.len() < 600, "{message}\n{text}");
}

/// Memory limit of a recipe or simulation, bytes.
const MAX_MEMORY: usize = 192 << 20;

#[test]
fn mutated_recipes_are_generated_or_refused() {
    let _lock = counting();
    let mut random = Random(15);
    for round in 0..48 {
        let recipe = mutated(RECIPES[round % RECIPES.len()], &mut random);
        let text = format!("[recipe]\n{recipe}");
        let result = within(&text, MAX_MEMORY, || -> limpid_io::Result<_> {
            let project = Project::parse(&text, "a.toml", Path::new(""))?;
            Ok(project.source.recipe().expect("it has one").particles()?)
        });
        match result {
            Ok(particles) => {
                assert!(particles.len() < 3000, "{}: {text}", particles.len());
                assert!(particles.positions.iter().all(|x| x.is_finite()), "{text}");
            }
            Err(error) => refused(&text, &error),
        }
    }
}

#[test]
fn mutated_simulations_are_baked_or_refused() {
    let _lock = counting();
    let mut random = Random(16);
    for round in 0..48 {
        let simulation = mutated(SIMULATIONS[round % SIMULATIONS.len()], &mut random);
        // Avoids numbers that give millions of valid particles, which take too long here.
        let text = format!("[simulation]\n{simulation}");
        let text = text.replace("radius = 1e-3", "radius = 1e-9");
        let text = text.replace("1e3", "1e5").replace("1e4", "1e5");
        let folder = tempfile::tempdir().expect("a temporary folder");
        let baked = within(&text, MAX_MEMORY, || {
            let mut project = Project::parse(&text, "a.toml", Path::new(""))?;
            let simulation = project.simulation_mut("a")?.clone();
            let solids = &project.scene.solids;
            let mut bake = Bake::in_folder(&simulation, solids, "a", folder.path())?;
            while bake.step()?.is_some_and(|progress| progress.done < 2) {}
            Ok(())
        });
        if let Err(error) = baked {
            refused(&text, &error);
        }
    }
}
