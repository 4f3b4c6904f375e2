//! Whitewater: potentials with closed forms, motion that is known, and what must not change its bits.

use glam::{DVec3, Vec3};
use limpid::diffuse::{Diffuse, DiffuseKind};
use limpid::liquid::Particles;
use limpid::scene::{Shape, Solid, Surface};
use limpid_sim::rng::splitmix64;
use limpid_sim::whitewater::{
    Choices, Flow, Passage, Potentials, Survey, Surveyor, Whitewater, duration, falls, velocities,
};

const RADIUS: f32 = 0.025;
const GRAVITY: f32 = 9.81;

/// Places of a cubic lattice with these numbers of particles along the axes, which begins at `min`.
fn lattice(counts: [usize; 3], min: Vec3, radius: f32) -> Vec<Vec3> {
    let [nx, ny, nz] = counts;
    let place = |i: usize| Vec3::new((i % nx) as f32, (i / nx % ny) as f32, (i / nx / ny) as f32);
    (0..nx * ny * nz).map(|i| min + 2.0 * radius * place(i)).collect()
}

fn flow(places: &[Vec3], radius: f32, velocity: impl Fn(Vec3, usize) -> Vec3) -> Flow {
    let particles = Particles::from_positions(places.to_vec());
    let velocities: Vec<Vec3> = places.iter().enumerate().map(|(i, &x)| velocity(x, i)).collect();
    Flow::new(&particles, &velocities, radius)
}

/// A survey of liquid that makes much, in an endless space.
fn survey() -> Survey {
    Survey {
        radius: RADIUS,
        gravity: GRAVITY,
        full: 33.5,
        head: [4.0, 16.0],
        air: [0.5, 2.0],
        crest: [0.03, 0.12],
        life: 0.5,
        rate: 100.0,
        population: 1e4,
        bounds: [DVec3::splat(-1e3), DVec3::splat(1e3)],
    }
}

fn generator(choices: Choices) -> Whitewater {
    Whitewater { choices, survey: survey() }
}

/// One particle that lives long.
fn single(kind: DiffuseKind, position: Vec3, velocity: Vec3) -> Diffuse {
    Diffuse {
        kinds: vec![kind],
        velocities: Some(vec![velocity]),
        ages: Some(vec![0.0]),
        lifetimes: Some(vec![1e3]),
        ..Diffuse::from_positions(vec![position], 0.2 * RADIUS)
    }
}

fn passage<'a>(before: &'a Flow, after: &'a Flow, seconds: f32) -> Passage<'a> {
    Passage { before, after, seconds, solids: &[], number: 1 }
}

fn interior(places: &[Vec3], i: usize) -> bool {
    let (min, max) = places.iter().fold((places[0], places[0]), |(a, b), &x| (a.min(x), b.max(x)));
    let margin = Vec3::splat(4.5 * RADIUS);
    places[i].cmpgt(min + margin).all() && places[i].cmplt(max - margin).all()
}

/// Two streams of speed u that cross trap as much air as a neighbour meets them on average: u. Liquid that moves as one
/// traps none, however fast.
#[test]
fn air_is_trapped_where_streams_meet() {
    let places = lattice([14; 3], Vec3::ZERO, RADIUS);
    // Weights of the 26 neighbours of a lattice within four radii.
    let weight = |distance: f32| 1.0 - distance / 4.0;
    let full =
        4.0 * (6.0 * weight(2.0) + 12.0 * weight(8_f32.sqrt()) + 8.0 * weight(12_f32.sqrt()));
    let mut state = 7;
    let signs: Vec<f32> =
        places.iter().map(|_| if splitmix64(&mut state) < 0.5 { -3.0 } else { 3.0 }).collect();
    let streams = Potentials::of(&flow(&places, RADIUS, |_, i| signs[i] * Vec3::X), full);
    let inside: Vec<f32> =
        (0..places.len()).filter(|&i| interior(&places, i)).map(|i| streams[i].air).collect();
    let mean = inside.iter().sum::<f32>() / inside.len() as f32;
    assert!((mean - 3.0).abs() < 0.15, "{mean}");
    let together = Potentials::of(&flow(&places, RADIUS, |_, _| Vec3::new(30.0, -40.0, 5.0)), full);
    assert!(together.iter().all(|own| own.air == 0.0));
    assert!(together.iter().all(|own| (own.square - 2525.0).abs() < 0.1));
}

/// In plane waves a particle meets its neighbours, which are r away, by the gradient g of the velocity along x: with
/// `|g r.x| - g r.x² / |r|` in a wave along its direction, with `|g r.x|` in one across it.
#[test]
fn plane_waves_trap_air_by_their_gradient() {
    const SPEED: f32 = 2.0;
    let places = lattice([80, 8, 8], Vec3::ZERO, RADIUS);
    // Means over the neighbours in the lattice.
    let offset = |i: i32| i.rem_euclid(3) - 1;
    let neighbours = (0..27).map(|i| [offset(i), offset(i / 3), offset(i / 9)].map(|n| n as f32));
    let neighbours = neighbours.map(|r| 2.0 * RADIUS * Vec3::from(r)).filter(|r| *r != Vec3::ZERO);
    let (mut weights, mut straight, mut along) = (0.0, 0.0, 0.0);
    for r in neighbours {
        let weight = 1.0 - r.length() / (4.0 * RADIUS);
        weights += weight;
        straight += weight * r.x.abs();
        along += weight * r.x * r.x / r.length();
    }
    // A wave has 80 particles.
    let k = std::f32::consts::TAU / (80.0 * 2.0 * RADIUS);
    for (direction, along) in [(Vec3::X, along), (Vec3::Z, 0.0)] {
        let wave = flow(&places, RADIUS, |x, _| SPEED * (k * x.x).cos() * direction);
        let all = Potentials::of(&wave, 4.0 * weights);
        let mut largest = 0.0_f32;
        for i in (0..places.len()).filter(|&i| interior(&places, i)) {
            let gradient = -SPEED * k * (k * places[i].x).sin();
            let expected = (gradient.abs() * straight - gradient * along) / weights;
            // The gradient changes over the neighbours.
            let error = (all[i].air - expected).abs() * weights / (SPEED * k * straight);
            assert!(error < 0.1, "{direction} {}: {}, expected {expected}", places[i], all[i].air);
            largest = largest.max(expected);
        }
        assert!(largest > 0.9 * SPEED * k * (straight + along) / weights);
    }
}

/// Liquid that approaches counts twice, liquid that recedes not at all (equation 2).
#[test]
fn receding_liquid_traps_no_air() {
    let places = [Vec3::ZERO, 2.0 * RADIUS * Vec3::X];
    let air = |speed: f32| {
        let toward = |x: Vec3, _| if x.x > 0.0 { -speed * Vec3::X } else { Vec3::ZERO };
        Potentials::of(&flow(&places, RADIUS, toward), 4.0)[0].air
    };
    assert!((air(1.0) - 2.0 * 0.5).abs() < 1e-6);
    assert_eq!(air(-1.0), 0.0);
}

/// Curvature of a ball that grows falls with the square of its radius; a flat surface and one that sinks have none.
#[test]
fn crests_are_convex_and_move_outwards() {
    let ball = |cells: f32| {
        let n = 2 * cells as usize + 3;
        let middle = Vec3::splat((n / 2) as f32 * 2.0 * RADIUS);
        let mut places = lattice([n; 3], -middle, RADIUS);
        places.retain(|x| x.length() < cells * 2.0 * RADIUS);
        let crest = |direction: f32| {
            let all = Potentials::of(
                &flow(&places, RADIUS, |x, _| direction * x.normalize_or_zero()),
                33.5,
            );
            let surface: Vec<f32> =
                all.iter().filter(|own| own.normal != Vec3::ZERO).map(|own| own.crest).collect();
            surface.iter().sum::<f32>() / surface.len() as f32
        };
        (crest(1.0), crest(-1.0))
    };
    let ((small, sinking), (large, _)) = (ball(5.0), ball(10.0));
    assert_eq!(sinking, 0.0);
    assert!((2.5..6.0).contains(&(small / large)), "{small} {large}");
    let places = lattice([14, 6, 14], Vec3::ZERO, RADIUS);
    let flat = Potentials::of(&flow(&places, RADIUS, |_, _| Vec3::Y), 33.5);
    let top = 5.0 * 2.0 * RADIUS;
    let mut seen = 0;
    for (x, own) in places.iter().zip(&flat) {
        let is_inside = |c: f32| c > 8.0 * RADIUS && c < 18.0 * RADIUS;
        if x.y > top - RADIUS && is_inside(x.x) && is_inside(x.z) {
            assert!(own.normal.y > 0.99 && own.crest < 1e-6, "{own:?}");
            seen += 1;
        }
    }
    assert!(seen >= 16);
}

/// Numbers of new particles are those of equations 1 to 8 of Ihmsen et al. 2012, here in 64 bits and over all pairs: on average
/// over seeds, each of which is off by no more than the rounding of its sources to whole particles.
#[test]
fn counts_are_those_of_the_potentials() {
    const SECONDS: f32 = 0.02;
    // A jet into a pool, with a ragged front.
    let mut state = 3;
    let mut noise = || 0.4 * RADIUS * (splitmix64(&mut state) as f32 - 0.5);
    let mut places = lattice([10, 5, 10], Vec3::ZERO, RADIUS);
    places.extend(lattice([5, 5, 5], Vec3::new(5.0, 9.5, 5.0) * RADIUS, RADIUS));
    places.iter_mut().for_each(|x| *x += Vec3::new(noise(), noise(), noise()));
    let velocity = |x: Vec3, _| match x.y > 9.0 * RADIUS {
        true => Vec3::new(0.4, -3.0 - 20.0 * x.x, 0.3),
        false => Vec3::new(0.0, 1.5 * x.x, 2.0 * x.z),
    };
    let flow = flow(&places, RADIUS, velocity);
    let survey = survey();
    let each = expected_counts(&places, |x| velocity(x, 0), &survey);
    let each: Vec<f64> = each.iter().map(|n| n * f64::from(SECONDS * survey.rate)).collect();
    let expected: f64 = each.iter().sum();
    let variance: f64 = each.iter().map(|n| n.fract() * (1.0 - n.fract())).sum();
    let seeds = 32;
    let (mut mean, mut worst) = (0.0, 0.0_f64);
    for seed in 0..seeds {
        let passage = passage(&flow, &flow, SECONDS);
        let made =
            generator(Choices { seed, ..Choices::default() }).step(&passage, &Diffuse::default());
        mean += made.len() as f64 / seeds as f64;
        worst = worst.max((made.len() as f64 - expected).abs());
    }
    assert!(expected > 50.0 && variance > 5.0, "{expected} ± {}", variance.sqrt());
    assert!(
        (mean - expected).abs() < 4.0 * (variance / seeds as f64).sqrt(),
        "{mean}, expected {expected}"
    );
    assert!(worst < 4.5 * variance.sqrt(), "{worst} from {expected}");
}

/// Expected numbers of particles that each particle emits, in times of `survey.rate`.
fn expected_counts(places: &[Vec3], velocity: impl Fn(Vec3) -> Vec3, survey: &Survey) -> Vec<f64> {
    let full = f64::from(survey.full);
    let radius = f64::from(RADIUS);
    let of: Vec<(DVec3, DVec3)> =
        places.iter().map(|&x| (x.as_dvec3(), velocity(x).as_dvec3())).collect();
    let near = |i: usize| -> Vec<(usize, f64)> {
        let weight = |j: usize| 1.0 - of[i].0.distance(of[j].0) / (4.0 * radius);
        let others = (0..of.len()).filter(|&j| j != i).map(|j| (j, weight(j)));
        others.filter(|(_, weight)| *weight > 0.0).collect()
    };
    let normal = |i: usize| {
        let (mut sum, mut weights) = (DVec3::ZERO, 0.0);
        for (j, weight) in near(i) {
            sum += weight * (of[i].0 - of[j].0).normalize();
            weights += weight;
        }
        if sum.length() > 0.25 * weights { sum.normalize() } else { DVec3::ZERO }
    };
    let normals: Vec<DVec3> = (0..of.len()).map(normal).collect();
    let clamped = |value: f64, [low, high]: [f32; 2]| {
        let [low, high] = [low, high].map(f64::from);
        (value.min(high) - value.min(low)) / (high - low)
    };
    let unit = (2.0 * f64::from(GRAVITY) * radius).sqrt();
    let each = |i: usize| {
        let (x, v) = of[i];
        let n = normals[i];
        let (mut air, mut crest, mut count) = (0.0, 0.0, 0.0);
        for (j, weight) in near(i) {
            let (apart, between) = (v - of[j].1, (x - of[j].0).normalize());
            air += weight * (apart.length() - apart.dot(between));
            let is_crest = n != DVec3::ZERO && v.dot(n) >= 0.6 * v.length();
            if is_crest && normals[j] != DVec3::ZERO && between.dot(n) > 0.0 {
                crest += weight * (1.0 - n.dot(normals[j]));
            }
            count += 1.0;
        }
        let [air, crest] = [air, crest].map(|sum| sum / (0.25 * full));
        let energy = clamped(v.length_squared() / unit.powi(2), survey.head);
        let potential = energy * (clamped(air / unit, survey.air) + clamped(crest, survey.crest));
        if count < 0.2 * full { 0.0 } else { potential }
    };
    (0..of.len()).map(each).collect()
}

/// A tank whose particles tremble makes nothing, whatever its own percentiles are.
#[test]
fn calm_liquid_makes_nothing() {
    let places = lattice([12, 8, 12], Vec3::ZERO, RADIUS);
    let unit = (2.0 * GRAVITY * RADIUS).sqrt();
    let mut state = 3;
    let noise: Vec<Vec3> = places
        .iter()
        .map(|_| {
            let random = || 2.0 * splitmix64(&mut state) as f32 - 1.0;
            0.3 * unit
                * Vec3::from_array([(); 3].map({
                    let mut random = random;
                    move |()| random()
                }))
        })
        .collect();
    let liquid = flow(&places, RADIUS, |_, i| noise[i]);
    let mut surveyor = Surveyor::new(RADIUS);
    surveyor.add(&liquid, (DVec3::ZERO, DVec3::ONE), &Surveyor::potentials(&liquid), &[]);
    let own = Whitewater { choices: Choices::default(), survey: surveyor.finish() };
    let made = own.step(&passage(&liquid, &liquid, 0.04), &Diffuse::default());
    assert!(made.is_empty() && own.survey.population == 0.0, "{} {:?}", made.len(), own.survey);
}

/// A splash: two blocks that collide, in any unit of length. A power of four scales every number exactly, as its root
/// scales the times.
fn splash(scale: f32, choices: Choices, steps: i64) -> (Survey, Vec<Diffuse>) {
    let radius = scale * RADIUS;
    let time = scale.sqrt();
    let seconds = time / 32.0;
    let places = lattice([20, 8, 8], Vec3::ZERO, radius);
    let middle = 19.0 * radius;
    let speed = 4.0 * scale / time;
    let velocity = |x: Vec3, i: usize| {
        let towards = if x.x < middle { speed } else { -speed };
        Vec3::new(towards, 0.25 * speed * (i % 7) as f32, 0.0)
    };
    let at = |k: f32| {
        let moved: Vec<Vec3> = (places.iter().enumerate())
            .map(|(i, &x)| x + k * 0.1 * seconds * velocity(x, i))
            .collect();
        let velocities: Vec<Vec3> =
            places.iter().enumerate().map(|(i, &x)| velocity(x, i)).collect();
        Flow::new(&Particles::from_positions(moved), &velocities, radius)
    };
    let mut surveyor = Surveyor::new(radius);
    for k in 0..3 {
        let liquid = at(k as f32);
        let potentials = Surveyor::potentials(&liquid);
        let bounds = (DVec3::splat(-f64::from(scale)), DVec3::splat(f64::from(2.0 * scale)));
        surveyor.add(&liquid, bounds, &potentials, &[]);
    }
    let own = Whitewater { choices, survey: surveyor.finish() };
    let mut states = vec![Diffuse::default()];
    for number in 1..=steps {
        let (before, after) = (at(number as f32 - 1.0), at(number as f32));
        let passage = Passage { before: &before, after: &after, seconds, solids: &[], number };
        states.push(own.step(&passage, &states[states.len() - 1]));
    }
    (own.survey, states)
}

#[test]
fn the_unit_of_length_does_not_matter() {
    let (survey, small) = splash(1.0, Choices::default(), 4);
    let (_, large) = splash(1024.0, Choices::default(), 4);
    let [foam, spray, bubbles, _] = small[4].counts();
    assert!(foam > 20 && spray > 20 && bubbles > 50, "{:?} {survey:?}", small[4].counts());
    for (small, large) in small.iter().zip(&large) {
        assert_eq!(small.kinds, large.kinds);
        let mut scaled = small.clone();
        scaled.scale(1024.0);
        assert_eq!(scaled.positions, large.positions);
        assert_eq!(scaled.radii, large.radii);
        // Speeds grow with the root.
        let faster = |all: &Diffuse| all.velocities.clone().unwrap_or_default();
        let expected: Vec<Vec3> = faster(small).into_iter().map(|v| 32.0 * v).collect();
        assert_eq!(expected, faster(large));
    }
}

#[test]
fn threads_change_nothing_and_seeds_do() {
    let on = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| splash(1.0, Choices { seed, ..Choices::default() }, 3).1)
    };
    let (one, four) = (on(1, 1), on(4, 1));
    assert_eq!(one, four);
    let other = on(2, 2);
    assert_ne!(other[3].positions, one[3].positions);
    // About as many.
    let (a, b) = (one[3].len() as f32, other[3].len() as f32);
    assert!((a / b - 1.0).abs() < 0.2, "{a} {b}");
    let twice = splash(1.0, Choices { amount: 0.5, ..Choices::default() }, 3).1;
    assert!((twice[3].len() as f32 / a - 0.5).abs() < 0.1, "{} {a}", twice[3].len());
}

/// Numbers of particles are bounded, and nothing is emitted beyond.
#[test]
fn memory_is_bounded() {
    let places = lattice([20, 8, 8], Vec3::ZERO, RADIUS);
    let mut state = 3;
    let signs: Vec<f32> = places.iter().map(|_| splitmix64(&mut state) as f32 - 0.5).collect();
    let wild = flow(&places, RADIUS, |_, i| 30.0 * signs[i] * Vec3::X);
    let own = Whitewater {
        choices: Choices::default(),
        survey: Survey { population: 400.0, rate: 1e6, ..survey() },
    };
    let made = own.step(&passage(&wild, &wild, 0.04), &Diffuse::default());
    assert_eq!(own.most(), 1200);
    assert!((1100..=1200).contains(&made.len()), "{}", made.len());
}

/// Spray flies on a parabola, exactly at any length of a step.
#[test]
fn spray_is_ballistic() {
    let far = flow(&[Vec3::ZERO], RADIUS, |_, _| Vec3::ZERO);
    let (x, v) = (Vec3::new(1.0, 50.0, 2.0), Vec3::new(3.0, 4.0, -1.0));
    let mut state = single(DiffuseKind::Spray, x, v);
    for _ in 0..10 {
        state = generator(Choices::default()).step(&passage(&far, &far, 0.04), &state);
    }
    let t = 0.4;
    let expected = x + t * v - 0.5 * GRAVITY * t * t * Vec3::Y;
    assert!(state.positions[0].distance(expected) < 1e-4, "{:?}", state.positions[0] - expected);
    assert_eq!(state.kinds, [DiffuseKind::Spray]);
}

/// A bubble in still water reaches 0.71 √(g d) (Davies and Taylor 1950), and foam drifts with its surface.
#[test]
fn bubbles_rise_and_foam_drifts() {
    let places = lattice([12, 20, 12], Vec3::ZERO, RADIUS);
    let still = flow(&places, RADIUS, |_, _| Vec3::ZERO);
    let at = Vec3::new(0.3, 0.25, 0.3);
    let mut state = single(DiffuseKind::Bubble, at, Vec3::ZERO);
    for _ in 0..8 {
        state = generator(Choices::default()).step(&passage(&still, &still, 0.04), &state);
    }
    let limit = 0.71 * (GRAVITY * 0.4 * RADIUS).sqrt();
    let velocity = state.velocities.as_ref().unwrap()[0];
    assert!((velocity.y / limit - 1.0).abs() < 1e-3, "{velocity} {limit}");
    assert_eq!(state.kinds, [DiffuseKind::Bubble]);
    // Near enough to the top it is foam, which no longer rises.
    for _ in 0..200 {
        state = generator(Choices::default()).step(&passage(&still, &still, 0.04), &state);
    }
    assert_eq!(state.kinds, [DiffuseKind::Foam]);
    let top = 38.0 * RADIUS;
    assert!((state.positions[0].y - top).abs() < 2.5 * RADIUS, "{}", state.positions[0].y - top);
    let drift = Vec3::new(0.5, 0.0, 0.25);
    let moving = |seconds: f32| {
        let moved: Vec<Vec3> = places.iter().map(|&x| x + seconds * drift).collect();
        flow(&moved, RADIUS, |_, _| drift)
    };
    let before = state.clone();
    let after =
        generator(Choices::default()).step(&passage(&moving(0.0), &moving(0.04), 0.04), &state);
    assert!((after.positions[0] - before.positions[0]).distance(0.04 * drift) < 1e-5);
    // Foam alone loses a second of life in a second.
    let left = |of: &Diffuse| of.lifetimes.as_ref().unwrap()[0];
    assert!((left(&before) - left(&after) - 0.04).abs() < 1e-3);
}

/// Spray lands on a solid and disappears there; below the sequence none is left.
#[test]
fn solids_and_the_ground_keep_particles_out() {
    let far = flow(&[100.0 * Vec3::ONE], RADIUS, |_, _| Vec3::ZERO);
    let plane = Shape::Plane { origin: DVec3::ZERO, normal: Vec3::Y, half_extent: f32::INFINITY };
    let solids = [Solid { shape: plane, surface: Surface::Color(Vec3::ONE), lit: false }];
    let mut state = single(DiffuseKind::Spray, Vec3::new(0.0, 0.5, 0.0), Vec3::new(1.0, -3.0, 0.0));
    let own = generator(Choices::default());
    for _ in 0..20 {
        let passage = Passage { solids: &solids, ..passage(&far, &far, 0.04) };
        state = own.step(&passage, &state);
        assert!(state.positions[0].y >= 0.0, "{}", state.positions[0]);
    }
    assert!(state.velocities.as_ref().unwrap()[0].y.abs() < 0.5);
    let bounded = Survey { bounds: [DVec3::splat(-1.0), DVec3::splat(1.0)], ..survey() };
    let own = Whitewater { choices: Choices::default(), survey: bounded };
    let mut state = single(DiffuseKind::Spray, Vec3::new(0.9, 0.0, 0.0), Vec3::new(9.0, 0.0, 0.0));
    state = own.step(&passage(&far, &far, 0.04), &state);
    assert_eq!(state.positions[0].x, 1.0);
    assert_eq!(state.velocities.as_ref().unwrap()[0].x, 0.0);
    for _ in 0..20 {
        state = own.step(&passage(&far, &far, 0.04), &state);
    }
    assert!(state.is_empty());
}

/// Dust rises from the ground below a river if it is asked for, and stays dust.
#[test]
fn rivers_raise_dust() {
    let places = lattice([20, 8, 12], Vec3::ZERO, RADIUS);
    let river = flow(&places, RADIUS, |_, _| 3.0 * Vec3::X);
    let made = |dust: bool| {
        let own = generator(Choices { dust, ..Choices::default() });
        let first = own.step(&passage(&river, &river, 0.04), &Diffuse::default());
        own.step(&passage(&river, &river, 0.04), &first)
    };
    assert_eq!(made(false).counts()[3], 0);
    let mut dust = made(true);
    let kinds = dust.kinds.clone();
    dust.retain(|i| kinds[i] == DiffuseKind::Dust);
    assert!(dust.len() > 20, "{}", dust.len());
    assert!(dust.positions.iter().all(|x| x.y < 6.0 * RADIUS));
}

/// Velocities, times and gravity of files without them.
#[test]
fn velocities_times_and_gravity_are_estimated() {
    let a = Particles {
        ids: Some((0..20).collect()),
        ..Particles::from_positions(lattice([20, 1, 1], Vec3::ZERO, 0.5))
    };
    let speed = |i: i64| Vec3::new(1.0, 0.1 * i as f32, 0.0);
    let order: Vec<i64> = (0..20).rev().chain([99]).collect();
    let moved = |&id: &i64| match id {
        99 => Vec3::splat(-7.0),
        id => a.positions[id as usize] + 0.1 * speed(id),
    };
    let mut b = Particles::from_positions(order.iter().map(moved).collect());
    b.ids = Some(order.clone());
    let found = velocities(&a, &b, 0.1).unwrap();
    for (id, v) in order.iter().zip(&found).take(20) {
        assert!(v.distance(speed(*id)) < 1e-4, "{id} {v}");
    }
    assert_eq!(found[20], Vec3::ZERO);
    // Without ids and with other numbers nothing is known.
    assert_eq!(velocities(&Particles { ids: None, ..a.clone() }, &b, 0.1), None);
    let with = |of: &Particles, v: Vec<Vec3>| Particles { velocities: Some(v), ..of.clone() };
    let (from, to) = (with(&a, (0..20).map(speed).collect()), with(&b, found));
    assert!((duration(&from, &to).unwrap() - 0.1).abs() < 1e-4);
    assert_eq!(duration(&a, &b), None);
    let (slow, mut fast) = (vec![3.0 * Vec3::X; 20], vec![Vec3::new(3.0, -981.0, 0.0); 21]);
    // These slow down, and rest.
    fast[0].x = -90.0;
    fast[1] = slow[1];
    assert_eq!(falls((&a, &slow), (&b, &fast), 0.1), vec![9810.0; 18]);
}

/// Files in millimetres show another gravity than the earth's, if enough particles agree on it.
#[test]
fn gravity_is_that_of_what_falls() {
    let of = |falls: &[f32]| {
        let places = lattice([4; 3], Vec3::ZERO, RADIUS);
        let still = flow(&places, RADIUS, |_, _| Vec3::ZERO);
        let mut surveyor = Surveyor::new(RADIUS);
        surveyor.add(&still, (DVec3::ZERO, DVec3::ONE), &Surveyor::potentials(&still), falls);
        surveyor.finish().gravity
    };
    let scattered: Vec<f32> = (1..200).map(|i| 100.0 * i as f32).collect();
    assert_eq!(of(&[]), 9.81);
    assert_eq!(of(&[9810.0; 40]), 9.81);
    assert_eq!(of(&scattered), 9.81);
    assert_eq!(of(&[vec![9810.0; 150], scattered].concat()), 9810.0);
    assert_eq!(of(&[12.0; 150]), 9.81);
}
