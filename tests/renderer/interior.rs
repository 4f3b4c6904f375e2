//! One splat for many particles deep inside a body changes no picture.

use std::collections::HashMap;

use glam::{DMat3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::liquid::classify::{Cloud, Splat, Splats};
use limpid::liquid::{Ellipsoid, Particles};
use limpid::settings::Classify;

use crate::support::frames::{Harness, harness, noise_vector, on_axis, scene};

const SIZE: UVec2 = UVec2::new(160, 120);
/// Particles along the sides of the body.
const SIDE: usize = 70;
/// Half the particle spacing, m.
const R: f32 = 1.0 / SIDE as f32;
/// Centre and radius of an air bubble in it, m.
const BUBBLE: (Vec3, f32) = (Vec3::new(0.31, 0.12, 0.47), 0.16);

/// A disordered ball of radius 1 m with a bubble.
fn ball() -> Vec<Vec3> {
    let mut seed = 7;
    let cells = 0..(SIDE + 12).pow(3);
    let place = |i: usize| {
        let cell = [i, i / (SIDE + 12), i / (SIDE + 12).pow(2)].map(|i| i % (SIDE + 12));
        let lattice =
            Vec3::from_array(cell.map(|k| 2.0 * R * (k as f32 - 0.5 * (SIDE + 11) as f32)));
        lattice + 0.15 * R * noise_vector(&mut seed)
    };
    let (centre, radius) = BUBBLE;
    let is_liquid = |x: &Vec3| x.length() < 1.16 && x.distance(centre) > radius;
    cells.map(place).filter(is_liquid).collect()
}

fn cloud(positions: Vec<Vec3>) -> Cloud {
    Cloud::new(&Particles { positions, ..Default::default() }, R)
}

fn interior(splats: &Splats) -> usize {
    splats.aggregates.iter().filter(|splat| splat.is_interior()).count()
}

/// Fewer splats, and those that are left are the same.
#[test]
fn all_other_splats_stay() {
    let positions = ball();
    let count = positions.len();
    let cloud = cloud(positions);
    let (merged, each) =
        (cloud.classify(&Classify::default()), cloud.classify_each(&Classify::default()));
    assert_eq!(interior(&each), 0);
    assert_eq!(each.aggregates.len() + each.splashes.len(), count);
    let (spheres, all) = (interior(&merged), merged.aggregates.len());
    eprintln!("{count} particles: {all} splats, {spheres} of them interior");
    assert!(all < count * 2 / 3 && spheres > 10_000, "{all} splats of {count}");
    assert_eq!(merged.splashes, each.splashes);
    let of_particle: HashMap<u32, &Splat> =
        each.aggregates.iter().map(|s| (s.particle, s)).collect();
    for splat in merged.aggregates.iter().filter(|splat| !splat.is_interior()) {
        assert_eq!(splat, of_particle[&splat.particle]);
    }
}

/// Interior spheres lie inside the liquid: they reach neither its outermost particles nor those around a bubble.
#[test]
fn spheres_lie_inside_the_liquid() {
    let splats = cloud(ball()).classify(&Classify::default());
    let (bubble, radius) = BUBBLE;
    for splat in splats.aggregates.iter().filter(|splat| splat.is_interior()) {
        let (centre, reach) = (Vec3::from_array(splat.centre), splat.diagonal[0]);
        let from_surface = 1.16 - centre.length() - reach;
        let from_bubble = centre.distance(bubble) - radius - reach;
        assert!(
            from_surface > 0.0 && from_bubble > 0.0,
            "{} r, {} r",
            from_surface / R,
            from_bubble / R
        );
    }
}

/// The ball from outside, near its surface, and from inside, towards the bubble and the surface; the bubble from its middle.
fn views() -> [Camera; 5] {
    let looking = |eye: Vec3, target: Vec3| Camera {
        eye: eye.as_dvec3(),
        target: target.as_dvec3(),
        ..on_axis(0.0, 50.0)
    };
    [
        on_axis(4.0, 40.0),
        looking(Vec3::new(0.4, 1.18, 0.4), Vec3::ZERO),
        looking(Vec3::new(-0.03, 0.02, 0.01), BUBBLE.0),
        looking(Vec3::new(-0.41, 0.13, -0.2), Vec3::new(1.0, 0.3, -2.0)),
        looking(BUBBLE.0, Vec3::new(0.0, 1.0, 0.2)),
    ]
}

/// Number of values of the layers and the picture that differ between two frames.
fn differences(harness: &mut Harness, a: &Splats, b: &Splats, camera: &Camera) -> usize {
    let scene = scene();
    let [a, b] = [a, b].map(|splats| harness.render(&scene, camera, splats, SIZE));
    let of_channel = |(name, values): (&String, &Vec<f32>)| {
        values.iter().zip(b.channel(name)).filter(|(x, y)| x.to_bits() != y.to_bits()).count()
    };
    a.channels.iter().map(of_channel).sum()
}

/// Pictures, layers and gaps are the same to the bit. A sphere that shows is noticed.
#[test]
fn pictures_are_the_same() {
    let Some(mut harness) = harness() else { return };
    let cloud = cloud(ball());
    let (merged, each) =
        (cloud.classify(&Classify::default()), cloud.classify_each(&Classify::default()));
    for (i, camera) in views().iter().enumerate() {
        assert_eq!(differences(&mut harness, &merged, &each, camera), 0, "view {i}");
    }
    let mut shown = merged;
    let front = shown.aggregates.iter_mut().filter(|splat| splat.is_interior());
    let front = front.max_by(|a, b| a.centre[2].total_cmp(&b.centre[2])).expect("interior spheres");
    front.centre[2] += 6.0 * R;
    assert!(differences(&mut harness, &shown, &each, &views()[0]) > 10);
}

/// Particles that differ keep their own splats, and so do those of smaller bodies.
#[test]
fn different_particles_are_not_merged() {
    let positions = ball();
    let (settings, count) = (Classify::default(), positions.len());
    let merged = |particles: Particles| interior(&Cloud::new(&particles, R).classify(&settings));
    let plain = || Particles { positions: positions.clone(), ..Default::default() };
    assert!(merged(plain()) > 10_000);
    let mut radii = vec![R; count];
    radii[17] *= 1.2;
    assert_eq!(merged(Particles { radii: Some(radii), ..plain() }), 0);
    let fluids = (0..count).map(|i| u8::from(i == 17)).collect();
    assert_eq!(merged(Particles { fluids: Some(fluids), ..plain() }), 0);
    let ellipsoids = Some(vec![Ellipsoid::SPHERE; count]);
    assert_eq!(merged(Particles { ellipsoids, ..plain() }), 0);
    assert_eq!(
        merged(Particles { positions: positions[..200_000].to_vec(), ..Default::default() }),
        0
    );
}

/// Spheres cover the liquid at least as well as the splats that they replace.
#[test]
fn the_interior_has_no_holes() {
    let cloud = cloud(ball());
    let settings = Classify::default();
    let [merged, each] = [cloud.classify(&settings), cloud.classify_each(&settings)];
    let mut seed = 3;
    let places: Vec<_> = (0..300).map(|_| 0.6 * noise_vector(&mut seed)).collect();
    let covered = |splats: &Splats| {
        let covers = |splat: &Splat, place: Vec3| {
            let offset = (place - Vec3::from_array(splat.centre)).as_dvec3();
            offset.length() < 4.0 * f64::from(R) && (axes(splat).inverse() * offset).length() <= 1.0
        };
        places.iter().filter(|&&place| splats.aggregates.iter().any(|s| covers(s, place))).count()
    };
    let (with_spheres, without) = (covered(&merged), covered(&each));
    assert!(without > 200 && with_spheres >= without, "{with_spheres} of {without} places");
}

fn axes(splat: &Splat) -> DMat3 {
    let ([xx, yy, zz], [xy, xz, yz]) = (splat.diagonal, splat.off_diagonal);
    DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz].map(f64::from))
}
