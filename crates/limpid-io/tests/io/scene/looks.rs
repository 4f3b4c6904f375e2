//! Parts that a look adds to a scene without them: a ground below liquid and solids, a light that something shows, and a
//! camera for pictures of any shape.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use limpid::environment::Environment;
use limpid::liquid::Particles;
use limpid::look::Framing;
use limpid::scene::{Scene, Shape, Solid};
use limpid_io::Error;
use limpid_io::adjustments::{Adjustments, Floor};
use limpid_io::input::{FrameTime, Input};
use limpid_io::notice::{self, Notice};
use limpid_io::open::{Opened, Request};

use super::parse;

/// A block of particles in the scene of a text.
fn opened(text: &str, request: &Request) -> Opened {
    let places = (0..1000)
        .map(|i| 0.1 * DVec3::new((i % 10).into(), (i / 10 % 10).into(), (i / 100).into()));
    let particles = Arc::new(Particles::from_places(&places.collect::<Vec<_>>()));
    let project = parse(text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    let input = Input::from_particles(particles, "block").with_project(project);
    request.open_from(input).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// Heights of a scene's endless level planes.
fn grounds(scene: &Scene) -> Vec<f64> {
    let height = |solid: &Solid| match solid.shape {
        Shape::Plane { origin, normal: Vec3::Y, half_extent } if half_extent.is_infinite() => {
            Some(origin.y)
        }
        _ => None,
    };
    scene.solids.iter().filter_map(height).collect()
}

const BOX: &str = "[[solid]]\nshape = \"box\"\nmin = [-0.2, -0.5, -0.2]\nmax = [1.2, 1.5, 1.2]\n";

/// Solids do not take the ground away, which lies below them; but a scene with an endless level plane has one of its own,
/// and `floor` says where it is, or that there is none.
#[test]
fn solids_keep_the_automatic_ground() {
    let of = |text: &str| grounds(&opened(text, &Request::default()).project.scene);
    let bare = of("");
    assert!(bare.len() == 1 && bare[0] < 0.0 && bare[0] > -0.2, "{bare:?}");
    let with_box = of(BOX);
    assert!(with_box.len() == 1 && with_box[0] < -0.5 && with_box[0] > -0.6, "{with_box:?}");
    let key = "[[solid.key]]\nframe = 0\ntranslate = [0, -2, 0]\n";
    let moved = of(&format!("{BOX}{key}"));
    assert!(moved.len() == 1 && moved[0] < -2.5 && moved[0] > -2.6, "{moved:?}");
    let plane = |origin: &str| format!("[[solid]]\nshape = \"plane\"\norigin = {origin}\n");
    assert_eq!(of(&plane("[0, -0.25, 0]")), [-0.25]);
    // A wall is no ground.
    assert_eq!(of(&format!("{}normal = [1, 0, 0]\n", plane("[-1, 0, 0]"))).len(), 1);
    assert!(of(&format!("floor = \"none\"\n{BOX}")).is_empty());
    assert_eq!(of(&format!("floor = -0.75\n{BOX}")), [-0.75]);
    assert_eq!(of("floor = 1"), [1.0]);
    let floor = Some(Floor::None);
    let request =
        Request { adjustments: Adjustments { floor, ..Default::default() }, ..Default::default() };
    assert!(grounds(&opened(BOX, &request).project.scene).is_empty());
}

/// Solids that move are still the same ones beside a ground.
#[test]
fn the_ground_leaves_moving_solids_theirs() {
    let text = format!("{BOX}[[solid.key]]\nframe = 0\ntranslate = [3, 0, 0]\n{BOX}");
    let Opened { loader: input, project, .. } = opened(&text, &Request::default());
    let loaded = input.load(FrameTime::at(0), &project.scene).expect("particles");
    let scene = loaded.scene(&project.scene);
    let lowest = |solid: &Solid| solid.shape.corners().map(|corners| corners[0].x);
    let lows: Vec<_> = scene.solids.iter().map(lowest).collect();
    assert_eq!(lows, [Some(-0.2 + 3.0), Some(-0.2), None]);
}

/// Scenes with a `floor` are written as they were read, and wrong ones are refused by name.
#[test]
fn floors_survive_saving() {
    for text in ["", "floor = \"none\"", "floor = -0.75", BOX, "look = \"pool\"\nfloor = 2.0"] {
        let project = parse(text).expect("a scene");
        let written = project.to_toml(None).expect("a text");
        assert_eq!(parse(&written).expect("a scene"), project, "{text}: {written}");
    }
    let complete = "[environment]\nradiance = [1, 1, 1]\n";
    for (text, problem) in [
        ("floor = \"below\"".to_owned(), "floor is \"below\": expected a height"),
        ("floor = true".to_owned(), "floor is true: expected a height"),
        ("floor = nan".to_owned(), "floor is nan: expected a height"),
        (format!("floor = 0.5\n{complete}"), "a scene with an [environment] is complete"),
    ] {
        let error = parse(&text).expect_err(&text);
        assert!(
            matches!(error, Error::Scene { .. }) && error.to_string().contains(problem),
            "{error}"
        );
    }
    parse(&format!("floor = \"none\"\n{complete}")).expect("it has none");
}

/// The remark on lights that nothing shows is about the user's own.
#[test]
fn looks_light_only_what_shows_it() {
    let remark = |text: &str| notice::of_scene(&opened(text, &Request::default()).project.scene);
    assert_eq!(remark(&format!("floor = \"none\"\n{BOX}")), None);
    assert_eq!(remark(BOX), None);
    let light = "[[light]]\nsun = { direction = [0, -1, 0], irradiance = [1, 1, 1] }\n";
    assert_eq!(remark(&format!("floor = \"none\"\n{BOX}{light}")), Some(Notice::Unlit));
    assert!(
        opened(&format!("floor = \"none\"\n{BOX}lit = true\n"), &Request::default())
            .project
            .scene
            .is_lit()
    );
}

/// The automatic camera is for the shape that is asked for, which leaves all else as it is, and a camera of the scene is
/// for any.
#[test]
fn cameras_follow_the_shape_of_the_picture() {
    let of = |text: &str, aspect, all_round| {
        let request = Request { framing: Framing { aspect, all_round }, ..Request::default() };
        opened(text, &request).project
    };
    let usual = of("", 4.0 / 3.0, false);
    let tall = of("", 9.0 / 16.0, false);
    let turning = of("", 4.0 / 3.0, true);
    assert_eq!(usual.scene, tall.scene);
    let distance = |project: &limpid_io::project::Project| {
        let camera = project.camera.expect("a camera");
        camera.eye.distance(camera.target)
    };
    assert!(distance(&tall) > 1.5 * distance(&usual), "{} {}", distance(&tall), distance(&usual));
    assert!(distance(&turning) > distance(&usual));
    let own = "[camera]\neye = [3, 2, 4]\ntarget = [0, 0, 0]\nfov_y = 40\n";
    assert_eq!(of(own, 0.5, true).camera, of(own, 2.0, false).camera);
    // The tank around the liquid is shown too.
    assert!(distance(&of(BOX, 4.0 / 3.0, false)) > 1.2 * distance(&usual));
}

/// The sky of one look goes with the rest of another, beside the scene's own light, and is written as it was read.
#[test]
fn skies_are_of_another_look() {
    let scene = |text: &str| opened(text, &Request::default()).project.scene;
    let (night, day) = (scene("look = \"night\""), scene("look = \"daylight\""));
    let text = "look = \"night\"\nsky = \"daylight\"";
    let both = scene(text);
    assert_eq!((&both.lights, &both.settings), (&night.lights, &night.settings));
    let zenith = |scene: &Scene| match scene.environment {
        Environment::Sky { zenith, .. } => zenith,
        ref other => panic!("{other:?}"),
    };
    assert_eq!(zenith(&both), zenith(&day));
    let project = parse(text).unwrap();
    assert_eq!(parse(&project.to_toml(None).unwrap()).unwrap(), project);
    let problem =
        parse("sky = \"pool\"\n[environment]\nradiance = [1, 1, 1]").unwrap_err().to_string();
    assert!(problem.contains("[environment] and sky"), "{problem}");
}

/// A value that is set is not the look's any more; the others of its pass are as the look has them.
#[test]
fn looks_leave_values_that_were_set() {
    let mut project = parse("").unwrap();
    let set = ["liquid.absorption=[0, 0, 7]", "tonemap.exposure=1.5", "caustics.blur=0.5"];
    project.set(&set.map(str::to_owned)).unwrap();
    let written = parse(&project.to_toml(None).unwrap()).unwrap();
    assert_eq!(written, project);
    let bare = opened("", &Request::default());
    let opened = opened(&project.to_toml(None).unwrap(), &Request::default());
    let (scene, look) = (opened.project.scene, bare.project.scene);
    assert_eq!(scene.liquid.absorption, Vec3::new(0.0, 0.0, 7.0));
    assert_eq!(
        (scene.settings.tonemap.exposure, scene.settings.tonemap.curve),
        (1.5, look.settings.tonemap.curve)
    );
    assert_eq!(
        (scene.settings.caustics.blur, scene.settings.caustics.grid),
        (0.5, look.settings.caustics.grid)
    );
    assert_eq!(scene.environment, look.environment);
}

/// Scene files have the fewest digits of 32-bit floats, and all of 64-bit ones.
#[test]
fn numbers_are_written_with_their_own_digits() {
    let text = "[liquid]\ntint_thickness = 0.1\nabsorption = [0.1, 0.2, 0.3]\n[[solid]]\nshape = \"sphere\"\n\
                center = [0.10000000149011612, 0.1, 0]\nradius = 0.1\n";
    let project = parse(text).unwrap();
    let written = project.to_toml(None).unwrap();
    for line in [
        "tint_thickness = 0.1",
        "absorption = [0.1, 0.2, 0.3]",
        "radius = 0.1",
        "center = [0.10000000149011612, 0.1, 0.0]",
    ] {
        assert!(written.lines().any(|own| own == line), "{line} in {written}");
    }
    assert_eq!(parse(&written).unwrap(), project);
    let problem = parse("[liquid]\ntint_thickness = 0").unwrap_err().to_string();
    assert!(problem.contains("tint_thickness must be above 0"), "{problem}");
}
