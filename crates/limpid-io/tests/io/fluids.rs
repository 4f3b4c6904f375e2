//! Absorption of several fluids: side by side, one behind the other, and in caustics; and how files and
//! interpolation treat each of them.

use glam::{DVec3, UVec2, Vec3};
use limpid::frame::FrameInput;
use limpid::liquid::Particles;
use limpid::liquid::classify::{Splat, Splats};
use limpid::scene::{Medium, Scene, Shape};
use limpid_io::input::{FrameTime, Input, Missing};
use limpid_io::project::Project;

use crate::support::frames::{
    FrameImages, Harness, View, glowing, harness, on_axis, scene, sphere, splats,
};

const SIZE: UVec2 = UVec2::new(64, 48);
const CLARET: Vec3 = Vec3::new(0.3, 2.0, 1.2);
const INK: Vec3 = Vec3::new(1.5, 0.9, 0.1);

fn of_fluid(splat: Splat, fluid: u32) -> Splat {
    Splat { tags: fluid, ..splat }
}

/// Fluids of index 1, which only absorb.
fn fluids(absorptions: &[Vec3]) -> Scene {
    let mut scene = scene();
    scene.liquid.ior = 1.0;
    scene.fluids = absorptions.iter().copied().map(Medium::clear).collect();
    scene
}

fn transmittance(absorption: Vec3, length: f64) -> DVec3 {
    (-absorption.as_dvec3() * length).exp()
}

#[track_caller]
fn assert_close(found: DVec3, expected: DVec3, what: &str) {
    assert!(found.abs_diff_eq(expected, 3e-3), "{what}: {found}, {expected} expected");
}

fn draw(harness: &mut Harness, scene: &Scene, splats: &Splats) -> FrameImages {
    let shot = harness.render(scene, &on_axis(6.0, 30.0), splats, SIZE);
    shot.assert_finite();
    shot
}

/// Length of a pixel's ray inside a sphere about `centre`, seen from 6 m along z.
fn chord(p: UVec2, centre: DVec3, radius: f64) -> f64 {
    let view = View::new(&on_axis(6.0, 30.0), SIZE);
    let d = view.through(p).normalize();
    let to_centre = view.point(centre);
    let beside = to_centre - to_centre.dot(d) * d;
    2.0 * (radius * radius - beside.length_squared()).max(0.0).sqrt()
}

/// Fluids side by side each have their own colour, as splashes and as aggregates.
#[test]
fn fluids_side_by_side() {
    let Some(mut harness) = harness() else { return };
    let (left, right) = (Vec3::new(-0.8, 0.0, 0.0), Vec3::new(0.8, 0.0, 0.0));
    let claret = of_fluid(sphere(left, 0.5), 0);
    let ink = of_fluid(sphere(right, 0.5), 1);
    for both in [splats(&[claret, ink], &[], 0.1), splats(&[ink], &[claret], 0.1)] {
        let shot = draw(&mut harness, &fluids(&[CLARET, INK]), &both);
        let mut seen = [0; 2];
        for p in shot.pixels() {
            for (i, (centre, absorption)) in [(left, CLARET), (right, INK)].into_iter().enumerate()
            {
                let length = chord(p, centre.as_dvec3(), 0.5);
                // Rims are excluded, where a pixel is partly outside the sphere.
                if length > 0.4 {
                    seen[i] += 1;
                    assert_close(
                        shot.radiance(p),
                        transmittance(absorption, length),
                        &format!("{p}"),
                    );
                }
            }
        }
        assert!(seen.iter().all(|&seen| seen > 30), "{seen:?}");
    }
}

/// Fluids one behind the other both absorb, each over its own path length, in either order.
#[test]
fn fluids_one_behind_the_other() {
    let Some(mut harness) = harness() else { return };
    let (near, far) = (sphere(Vec3::Z, 0.75), sphere(Vec3::new(0.0, 0.0, -0.25), 0.5));
    let middle = SIZE / 2;
    let expected = transmittance(CLARET, 1.5) * transmittance(INK, 1.0);
    let shot = draw(
        &mut harness,
        &fluids(&[CLARET, INK]),
        &splats(&[of_fluid(near, 0), of_fluid(far, 1)], &[], 0.1),
    );
    assert_close(shot.radiance(middle), expected, "claret in front");
    let expected = transmittance(INK, 1.5) * transmittance(CLARET, 1.0);
    let shot = draw(
        &mut harness,
        &fluids(&[INK, CLARET]),
        &splats(&[of_fluid(far, 1), of_fluid(near, 0)], &[], 0.1),
    );
    assert_close(shot.radiance(middle), expected, "ink in front");
}

/// Elision: fluids of equal colour are one fluid, with a bit-identical picture and no mixture pass.
#[test]
fn fluids_of_equal_colour_need_no_mixture_pass() {
    let Some(mut harness) = harness() else { return };
    let camera = on_axis(6.0, 30.0);
    let two = splats(
        &[of_fluid(sphere(Vec3::X, 0.5), 0), of_fluid(sphere(Vec3::NEG_X, 0.5), 1)],
        &[],
        0.1,
    );
    let mut single = scene();
    single.liquid.ior = 1.0;
    single.liquid.absorption = CLARET;
    let picture = draw(&mut harness, &single, &two).picture;
    assert_eq!(draw(&mut harness, &fluids(&[CLARET, CLARET]), &two).picture, picture);
    assert_ne!(draw(&mut harness, &fluids(&[CLARET, INK]), &two).picture, picture);
    for (absorptions, expected) in [([CLARET, CLARET], false), ([CLARET, INK], true)] {
        let Harness { gpu, renderer } = &mut *harness;
        let target = limpid::offscreen::Picture::new(gpu, SIZE).unwrap();
        let scene = fluids(&absorptions);
        let input = FrameInput { timing: true, ..FrameInput::new(&scene, &camera, &two, SIZE) };
        let passes = renderer.render(input, &target).unwrap();
        let mixes = passes.iter().any(|pass| pass.name == "mixture");
        assert_eq!(mixes, expected && !passes.is_empty());
    }
}

/// Caustics of light through a fluid have the fluid's colour.
#[test]
fn caustics_have_the_colour_of_their_fluid() {
    let Some(mut harness) = harness() else { return };
    let floor =
        Shape::Plane { origin: DVec3::new(0.0, -1.0, 0.0), normal: Vec3::Y, half_extent: 9.0 };
    let both = [
        of_fluid(sphere(Vec3::new(-1.0, 0.0, 0.0), 0.5), 0),
        of_fluid(sphere(Vec3::new(1.0, 0.0, 0.0), 0.5), 1),
    ];
    let both = splats(&both, &[], 0.1);
    let mut scene = fluids(&[CLARET, INK]);
    let mut receiver = glowing(floor, Vec3::ONE);
    receiver.lit = true;
    scene.solids = vec![receiver];
    let sun = limpid::scene::Light::Sun { direction: Vec3::NEG_Y, irradiance: Vec3::splat(1.0) };
    scene.lights = vec![sun];
    scene.settings.classify.wetting = 0.0;
    scene.settings.refract.contact = 0.0;
    let camera = limpid::camera::Camera {
        eye: DVec3::new(0.0, 4.0, 6.0),
        target: DVec3::new(0.0, -1.0, 0.0),
        ..on_axis(6.0, 40.0)
    };
    harness.render(&scene, &camera, &both, SIZE).assert_finite();
    let map = harness.renderer.images().caustics[0].clone().expect("a map");
    let (texels, _) = map.read(&harness.gpu).unwrap();
    // The texels below the balls' centres.
    for (centre, absorption) in [(-1.0, CLARET), (1.0, INK)] {
        let size = map.view.size.as_dvec2();
        let at = map.view.view_from_world * (DVec3::new(centre, -1.0, 0.0) - map.view.origin);
        let u = (at.truncate() / map.view.half_extent * glam::DVec2::new(0.5, -0.5) + 0.5) * size;
        let texel = texels[u.y as usize * map.view.size.x as usize + u.x as usize];
        let found = DVec3::from_array([texel[0], texel[1], texel[2]].map(f64::from));
        let expected = transmittance(absorption, 1.0);
        assert!(found.abs_diff_eq(expected, 0.02), "{found}, {expected} expected");
    }
}

/// From files to splats: each fluid has its own radius, frame and up axis, and an index in the scene's
/// order; absorptions and colours of the scene file are converted correctly.
#[test]
fn a_scene_of_two_fluids() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("a_1.xyz", "0 0 0\n0.2 0 0\n");
    write("a_2.xyz", "0 0 0\n0.2 0 0\n");
    write("b_2.xyz", "0 0 1\n0.4 0 1\n0.8 0 1\n");
    write(
        "scene.toml",
        "[[fluid]]\nsource = \"a_{}.xyz\"\nframe = 2\nabsorption = [1.0, 2.0, 3.0]\n\
         [[fluid]]\nsource = \"b_{}.xyz\"\nup = \"z\"\ncolor = [0.5, 1.0, 0.25]\n",
    );
    let path = folder.path().join("scene.toml");
    let (mut input, project) = Input::open(path.to_str().unwrap()).unwrap().resolve().unwrap();
    let scene = project.scene;
    let ln2 = std::f32::consts::LN_2;
    assert_eq!(scene.absorptions(), [Vec3::new(1.0, 2.0, 3.0), Vec3::new(ln2, 0.0, 2.0 * ln2)]);
    assert_eq!(input.frame, Some(2));
    let particles = input.particles(input.sequence.frame(2).unwrap()).unwrap();
    assert_eq!(particles.fluids, Some(vec![0, 0, 1, 1, 1]));
    assert_eq!(particles.radii, Some(vec![0.1, 0.1, 0.2, 0.2, 0.2]));
    assert_eq!(particles.positions[3], Vec3::new(0.4, 1.0, 0.0));
    let loaded = input.load(input.sequence.frame(2).unwrap(), &scene).unwrap();
    let of_b = |splat: &&Splat| splat.fluid() == 1;
    let all = || loaded.splats.aggregates.iter().chain(&loaded.splats.splashes);
    assert_eq!((all().count(), all().filter(of_b).count()), (5, 3));

    // A frame that one fluid lacks.
    let first = input.sequence.frame(1).expect("one fluid has it").clone();
    assert!(input.particles(&first).unwrap_err().to_string().contains("frame 1 is missing"));
    input.missing = Missing::Empty;
    assert_eq!(input.particles(&first).unwrap().len(), 2);

    for (bad, problem) in [
        ("[[fluid]]\nsource = \"a\"\n[particles]\nsource = \"b\"", "takes one of"),
        ("[[fluid]]\nsource = \"a\"\ncolor = [0.0, 1.0, 1.0]", "color must be above 0"),
        ("[[fluid]]\nsource = \"a\"\nabsorption = [-1.0, 1.0, 1.0]", "not be negative"),
        ("[[fluid]]\nsource = \"a\"\nabsorption = [1, 1, 1]\ncolor = [1, 1, 1]", "one of"),
        ("[[fluid]]\nsource = \"a\"\nfps = 0.0", "fps must be above 0"),
        ("[[fluid]]\nsource = \"a\"\ncolour = [1, 1, 1]", "did you mean `color`"),
    ] {
        let error = Project::parse(bad, "scene", folder.path()).unwrap_err().to_string();
        assert!(error.contains(problem), "{bad}: {error}");
    }
}

/// Each fluid is interpolated by its own ids, whatever particles appear in the other, and in whatever
/// order the files list them.
#[test]
fn fluids_are_interpolated_separately() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, particles: &[(i64, f32)]| {
        let positions = particles.iter().map(|&(_, x)| Vec3::X * x).collect();
        let ids = Some(particles.iter().map(|&(id, _)| id).collect());
        let frame = Particles { ids, ..Particles::from_positions(positions) };
        limpid_io::particles::write(&frame, &folder.path().join(name)).unwrap();
    };
    write("a_1.bgeo", &[(1, 0.0), (2, 10.0)]);
    write("a_2.bgeo", &[(2, 12.0), (1, 2.0)]);
    write("b_1.bgeo", &[(1, 100.0)]);
    write("b_2.bgeo", &[(1, 104.0), (7, 200.0)]);
    let fluid = |name: &str| format!("[[fluid]]\nsource = \"{name}_{{}}.bgeo\"\nradius = 0.1\n");
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, fluid("a") + &fluid("b")).unwrap();
    let input = Input::open(path.to_str().unwrap()).unwrap().loader;
    let middle = FrameTime { frame: 1, next: 2, fraction: 0.25 };
    let particles = input.particles(middle).unwrap();
    let places: Vec<f32> = particles.positions.iter().map(|x| x.x).collect();
    assert_eq!(places, [0.5, 10.5, 101.0]);
    assert_eq!(particles.fluids, Some(vec![0, 0, 1]));
    // A frame that one fluid lacks is reported before anything is drawn.
    input.check_frames(&[1, 2]).unwrap();
    std::fs::remove_file(folder.path().join("b_2.bgeo")).unwrap();
    let mut input = Input::open(path.to_str().unwrap()).unwrap().loader;
    let error = input.check_frames(&[1, 2]).unwrap_err().to_string();
    assert!(error.contains("b_{}.bgeo") && error.contains("frame 2 is missing"), "{error}");
    input.missing = Missing::Hold;
    input.check_frames(&[1, 2]).unwrap();
}
