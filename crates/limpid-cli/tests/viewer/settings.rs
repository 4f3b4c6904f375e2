//! Settings and views: the table of controls, comparison of scenes, command lines, and cameras as text.

use std::collections::BTreeSet;

use glam::{DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::settings::Settings;
use limpid_io::input::FrameTime;
use limpid_io::project::controls::{CONTROLS, Control, ControlKind, PASSES, Value, differences};
use limpid_io::project::overrides::replaced;
use limpid_io::shared_classifier::Processor;
use limpid_viewer::app::command_line::{command_line, quoted};
use limpid_viewer::model::coloring::Coloring;
use limpid_viewer::model::document::Document;

use super::sequence;

/// The table of controls has every field of the settings once, with the exact range of `Settings::check`
/// and all choices.
#[test]
fn controls_match_the_settings() {
    let table = toml::Table::try_from(Settings::default()).expect("a table");
    let fields: BTreeSet<String> = table
        .iter()
        .flat_map(|(pass, all)| {
            let all = all.as_table().expect("a table of each pass");
            all.keys().map(move |key| format!("{pass}.{key}"))
        })
        .collect();
    let controls: BTreeSet<String> = CONTROLS.iter().map(Control::path).collect();
    assert_eq!(controls.len(), CONTROLS.len(), "a control is repeated");
    assert_eq!(controls, fields);
    let passes: BTreeSet<&str> = PASSES.iter().map(|(pass, _)| *pass).collect();
    assert_eq!(passes, table.keys().map(String::as_str).collect());

    for control in &CONTROLS {
        let with = |value: String| {
            let settings = replaced(&Settings::default(), &[format!("{}={value}", control.path())]);
            settings.and_then(|settings| Ok(settings.check().map(|()| settings)?))
        };
        let path = control.path();
        match control.kind {
            ControlKind::Number(low, high, _) => {
                let (low, high) = (low as f32, high as f32);
                assert!(
                    with(format!("{low:?}")).is_ok() && with(format!("{high:?}")).is_ok(),
                    "{path}"
                );
                let (below, above) = (low.next_down(), high.next_up());
                assert!(with(format!("{below:?}")).is_err(), "{path} below {low}");
                assert!(with(format!("{above:?}")).is_err(), "{path} above {high}");
            }
            ControlKind::Whole(low, high, _) | ControlKind::Odd(low, high, _) => {
                assert!(with(low.to_string()).is_ok() && with(high.to_string()).is_ok(), "{path}");
                assert!(low == 0 || with((low - 1).to_string()).is_err(), "{path} below {low}");
                assert!(with((high + 1).to_string()).is_err(), "{path} above {high}");
                let odd = matches!(control.kind, ControlKind::Odd(..));
                assert_eq!(with((low + 1).to_string()).is_err(), odd, "{path}: odd numbers only");
            }
            ControlKind::Toggle => {
                let Value::Toggle(_) = control.get(&Settings::default()) else {
                    panic!("{path} is not a toggle")
                };
            }
            ControlKind::Choice(names) => {
                for name in names {
                    let settings = with((*name).to_owned()).expect("a choice");
                    assert_eq!(control.get(&settings), Value::Choice((*name).to_owned()));
                }
                let error = with("nothing".into()).expect_err("no such choice").to_string();
                let known = error.split("expected ").nth(1).unwrap_or_default();
                let known = known.split(';').next().unwrap_or_default();
                let known: BTreeSet<&str> = known.split('`').skip(1).step_by(2).collect();
                assert_eq!(known, names.iter().copied().collect(), "{path}: {error}");
            }
        }
    }
}

/// `--set` on the copied command line preserves values exactly.
#[test]
fn values_survive_the_command_line() {
    let mut settings = Settings::default();
    settings.smooth.sigma = 0.1 + 0.2;
    settings.tonemap.exposure = -1.0 / 3.0;
    settings.caustics.blur = 1e-9;
    settings.refract.contact = 1.0;
    let changed = differences(&Settings::default(), &settings);
    assert_eq!(changed.len(), 4);
    let overrides: Vec<String> =
        changed.iter().map(|(control, value)| format!("{}={value}", control.path())).collect();
    assert_eq!(replaced(&Settings::default(), &overrides).expect("settings"), settings);
}

/// Environments are equal if and only if their contents are, whether or not they share their pixels. The
/// interface compares scenes in every frame.
#[test]
fn environments_compare_by_content() {
    let map = |pixels: Vec<[f32; 4]>, width: u32| Environment::Map {
        size: UVec2::new(width, pixels.len() as u32 / width),
        pixels: pixels.into(),
    };
    let one = map(vec![[0.5; 4]; 8], 4);
    assert_eq!(one, one.clone());
    assert_eq!(one, map(vec![[0.5; 4]; 8], 4));
    let mut other = vec![[0.5; 4]; 8];
    other[7][2] = 0.25;
    let gradient = |nadir: f32| Environment::Gradient {
        zenith: Vec3::ONE,
        horizon: Vec3::ONE,
        nadir: Vec3::splat(nadir),
    };
    let all = [
        one,
        map(other, 4),
        map(vec![[0.5; 4]; 8], 2),
        Environment::Constant(Vec3::ONE),
        Environment::Constant(Vec3::ZERO),
        gradient(0.0),
        gradient(1.0),
    ];
    for (i, a) in all.iter().enumerate() {
        for (j, b) in all.iter().enumerate() {
            assert_eq!(a == b, i == j, "{i} and {j}");
        }
    }
}

/// A shell reads quoted words unchanged.
#[test]
fn quoted_words_survive_a_shell() {
    for word in ["plain-1.bgeo", "a b", "it's", "$HOME", "`x`", "\\", "*", "", "{}", "a\"b", "~"] {
        let output = std::process::Command::new("sh")
            .args(["-c", &format!("printf %s {}", quoted(word))])
            .output()
            .expect("there is a shell");
        assert_eq!(String::from_utf8_lossy(&output.stdout), word);
    }
}

/// A command line contains only the settings that differ from the document's, and the exact camera.
#[test]
fn command_line_contains_differences_only() {
    let source = sequence();
    let document = Document::open(&source).expect("it opens");
    let camera = document.project.camera.expect("it is resolved");
    let size = UVec2::new(64, 48);
    let plain = command_line(
        &document,
        (&document.project.scene, Processor::Auto, &Coloring::default()),
        &camera,
        FrameTime::at(20),
        size,
        "a b.png",
    );
    assert!(!plain.contains("--set"), "{plain}");
    assert!(plain.contains("--frames=20") && plain.ends_with("-o 'a b.png'"), "{plain}");
    let written = plain.split("--camera='").nth(1).and_then(|rest| rest.split('\'').next());
    assert_eq!(written.expect("a camera").parse::<Camera>().expect("a camera"), camera);
}

/// A camera written as text for `--camera` is read back bit-exactly; invalid text is refused with its
/// problem.
#[test]
fn camera_survives_its_text() {
    let camera = Camera {
        eye: DVec3::new(0.1 + 0.2, -1.0 / 3.0, 1e-17),
        target: DVec3::new(1e4, -0.0, 5.5),
        up: Vec3::new(0.1, 0.9, -0.3),
        fov_y: 38.7,
        near: Some(0.1),
        lens: None,
    };
    assert_eq!(camera.to_string().parse::<Camera>().expect("a camera"), camera);
    let plain = Camera { up: Vec3::Y, near: None, ..camera };
    assert_eq!(plain.to_string().parse::<Camera>().expect("a camera"), plain);
    for (text, problem) in [
        ("eye=1,2,3 fov_y=40", "target"),
        ("eye=1,2 target=0,0,0 fov_y=40", "eye"),
        ("eye=1,2,x target=0,0,0 fov_y=40", "eye=1,2,x"),
        ("eye=0,0,0 target=0,0,0 fov_y=40", "same point"),
        ("eye", "name=value"),
    ] {
        let error = text.parse::<Camera>().expect_err(text).to_string();
        assert!(error.contains(problem), "{text}: {error}");
    }
}
