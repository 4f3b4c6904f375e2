//! The panels: complete controls, each of which changes its own setting only.

use eframe::egui::accesskit::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use limpid::settings::Preset;
use limpid_io::project::controls::{CONTROLS, Control, ControlKind, Value, differences};
use limpid_viewer::model::document::Source;
use limpid_viewer::model::shortcuts::{POINTER, SHORTCUTS};
use limpid_viewer::{Options, Viewer};

use super::{harness, sequence, show_tab, shown, until, wait};

/// Showing panels and moving the focus through them changes no value, neither those of any preset nor
/// values between the steps of a slider.
#[test]
fn panels_change_nothing_by_being_shown() {
    let odd = [
        "smooth.sigma=0.123456789",
        "smooth.window=7.654321",
        "classify.short_axis=1.2345678",
        "classify.support=3.3333333",
        "tonemap.exposure=-0.3333333",
        "caustics.blur=0.0000123456",
        "caustics.margin=0.1234567",
        "refract.reach=0.000123456",
        "refract.contact=2.7182817",
        "liquid.ior=1.3333333",
        "liquid.absorption=[0.000001, 0.3333333, 99999.99]",
    ];
    let presets = Preset::ALL.map(|preset| vec![format!("preset={preset}")]);
    for overrides in presets.into_iter().chain([odd.map(str::to_owned).to_vec()]) {
        let scene = concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/sims/slab.toml");
        let source = Source { overrides, ..Source::new(scene) };
        let options = Options { source: Some(source), ..Options::default() };
        let mut harness = shown(Viewer::new(options).expect("a viewer"), [1000.0, 2400.0]);
        let opened = harness.state().scenes().clone();
        // Only the part after the picture's size, which may change with the panel's.
        let drawn = |harness: &Harness<'static, Viewer>| {
            let command = harness.state().command_line("x").expect("open");
            command.split_once("--camera").expect("a camera").1.to_owned()
        };
        let before = drawn(&harness);
        show_tab(&mut harness, "Settings");
        for title in ["Particles to splats", "Caustics", "Radiance to picture"] {
            harness.get_by_label(title).click_accesskit();
            harness.step();
            harness.step();
        }
        for tab in ["Settings", "Camera", "Scene"] {
            harness.get_by_label(tab).click_accesskit();
            harness.step();
            // The focus passes every field and slider of the panel, and wraps around.
            for _ in 0..150 {
                harness.key_press(eframe::egui::Key::Tab);
                harness.step();
            }
        }
        assert_eq!(*harness.state().scenes(), opened);
        assert_eq!(drawn(&harness), before);
    }
}

/// The traced truth applies only to the view, the frame time and the liquid that it was traced for:
/// after a change of the liquid it must be traced again.
#[test]
fn truth_applies_only_to_its_own_liquid() {
    let scene =
        Source::new(concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/sims/slab.toml"));
    let mut harness = harness(scene, [1000.0, 700.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    harness.get_by_label("Times").click_accesskit();
    harness.step();
    harness.step();
    harness.get_by_label("Trace the truth of this view").click_accesskit();
    wait(&mut harness, "a point", |harness| {
        harness.query_by_label_contains("these settings:").is_some()
    });
    assert!(harness.query_by_label_contains("trace the truth again").is_none());
    harness.get_by_label("Settings").click_accesskit();
    harness.step();
    harness.step();
    harness.get_by_role_and_label(Role::Slider, "Refractive index").set_value_accesskit(1.5);
    harness.step();
    harness.get_by_label("Times").click_accesskit();
    wait(&mut harness, "the notice", |harness| {
        harness.query_by_label_contains("trace the truth again").is_some()
    });
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    assert!(harness.query_by_label_contains("trace the truth again").is_some());
}

/// A viewer tall enough for all settings, with all sections open.
fn all_settings() -> Harness<'static, Viewer> {
    let scene =
        Source::new(concat!(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."), "/sims/slab.toml"));
    let mut harness = harness(scene, [1000.0, 2400.0]);
    show_tab(&mut harness, "Settings");
    for title in ["Particles to splats", "Splats to layers", "Caustics", "Radiance to picture"] {
        harness.get_by_label(title).click();
        harness.run_ok();
    }
    for _ in 0..30 {
        harness.step();
    }
    harness
}

/// Index of a control's widget among those with the same label, since passes share names of settings.
fn index_among_equal_labels(control: &Control) -> usize {
    let before = CONTROLS.iter().take_while(|c| c.path() != control.path());
    before.filter(|c| c.label == control.label).count()
}

fn role(control: &Control) -> Role {
    match control.kind {
        ControlKind::Number(..) | ControlKind::Whole(..) | ControlKind::Odd(..) => Role::Slider,
        ControlKind::Toggle => Role::CheckBox,
        ControlKind::Choice(_) => Role::ComboBox,
    }
}

/// Every setting has a widget that changes this setting only, the change is drawn, and its pass can be
/// reset.
#[test]
fn every_control_changes_only_its_setting() {
    let mut harness = all_settings();
    let opened = harness.state().scenes()[0].settings.clone();
    for control in &CONTROLS {
        let path = control.path();
        let node = || {
            let all = harness.query_all_by_role_and_label(role(control), control.label);
            all.into_iter().nth(index_among_equal_labels(control))
        };
        let node = node().unwrap_or_else(|| panic!("no control for {path}"));
        match control.kind {
            ControlKind::Number(low, high, _) => {
                node.set_value_accesskit(0.25 * low + 0.05 * high.min(99.0) + 0.01);
            }
            ControlKind::Whole(low, high, _) => {
                node.set_value_accesskit(f64::from(if low + 1 == high { low } else { low + 2 }));
            }
            ControlKind::Odd(..) => node.set_value_accesskit(9.0),
            ControlKind::Toggle => node.click_accesskit(),
            ControlKind::Choice(_) => node.click_accesskit(),
        }
        harness.step();
        if let ControlKind::Choice(names) = control.kind {
            let Value::Choice(present) = control.get(&opened) else { unreachable!() };
            let other = names.iter().find(|name| **name != present).expect("there are several");
            harness.step();
            harness.get_by_role_and_label(Role::Button, other).click_accesskit();
            harness.step();
        }
        harness.step();
        let settings = harness.state().scenes()[0].settings.clone();
        let changed: Vec<String> =
            differences(&opened, &settings).iter().map(|(control, _)| control.path()).collect();
        assert_eq!(changed, std::slice::from_ref(&path), "{path}");
        let command = harness.state().command_line("x.png").expect("open");
        assert!(command.contains(&path), "{path} is not drawn: {command}");
        harness.get_by_label(&format!("Reset {}", control.pass)).click_accesskit();
        harness.step();
        harness.step();
        assert_eq!(harness.state().scenes()[0].settings, opened, "{path} is not reset");
    }
}

/// The liquid's controls, the presets, *Copy A to B* and *Reset all*.
#[test]
fn liquid_and_presets_change_and_reset() {
    let mut harness = all_settings();
    let opened = harness.state().scenes()[0].clone();
    harness.get_by_role_and_label(Role::Slider, "Refractive index").set_value_accesskit(1.5);
    harness.get_by_role_and_label(Role::Slider, "Absorption, green").set_value_accesskit(7.0);
    harness.step();
    let scene = &harness.state().scenes()[0];
    assert_eq!((scene.liquid.ior, scene.liquid.absorption.y), (1.5, 7.0));
    let command = harness.state().command_line("x.png").expect("open");
    assert!(command.contains("liquid.ior=1.5") && command.contains("liquid.absorption="));
    harness.get_by_role_and_label(Role::ComboBox, "Preset").click_accesskit();
    harness.step();
    harness.step();
    harness.get_by_role_and_label(Role::Button, "imai2016").click_accesskit();
    harness.step();
    harness.step();
    let expected =
        limpid_io::project::overrides::replaced(&opened.settings, &["preset=imai2016".into()])
            .expect("a preset");
    assert_eq!(harness.state().scenes()[0].settings, expected);
    // Scene B is independent of A.
    assert_eq!(harness.state().scenes()[1], opened);
    harness.get_by_label("Copy A to B").click_accesskit();
    harness.step();
    assert_eq!(harness.state().scenes()[1].settings, expected);
    harness.get_by_label("Reset all").click_accesskit();
    harness.step();
    harness.step();
    assert_eq!(harness.state().scenes()[0], opened);
}

/// `?` lists every shortcut and the pointer's actions.
#[test]
fn question_mark_lists_every_key() {
    let mut harness = harness(sequence(), [1280.0, 800.0]);
    assert!(harness.query_by_label(SHORTCUTS[0].help).is_none());
    harness.key_press_modifiers(eframe::egui::Modifiers::SHIFT, eframe::egui::Key::Slash);
    harness.step();
    harness.step();
    let texts = SHORTCUTS.iter().flat_map(|s| [s.shown, s.help]);
    for text in texts.chain(POINTER.iter().flat_map(|&(how, what)| [how, what])) {
        assert!(harness.query_all_by_label(text).next().is_some(), "{text} is not listed");
    }
}

/// The camera panel and the wheel change the height of a camera with parallel rays.
#[test]
fn height_of_parallel_cameras_can_be_changed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("parallel.toml");
    let text = "[recipe]\nkind = \"ball\"\ncenter = [0, 0, 0]\nradius = 0.5\ncount = 200\n\
                [camera]\neye = [0, 1, 4]\ntarget = [0, 0, 0]\nheight = 2.0\n";
    std::fs::write(&path, text).expect("it is written");
    let mut harness = harness(Source::new(path.display().to_string()), [900.0, 600.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let height = |harness: &Harness<'static, Viewer>| -> f64 {
        let command = harness.state().command_line("x").expect("open");
        let rest = command.split_once("height=").expect("a height").1;
        rest.split([' ', '\'']).next().and_then(|text| text.parse().ok()).expect("a number")
    };
    assert_eq!(height(&harness), 2.0);
    harness.get_by_label("Camera").click_accesskit();
    harness.step();
    harness.step();
    assert!(harness.query_by_label("Field of view").is_none());
    harness.get_by_role_and_label(Role::Slider, "Height").set_value_accesskit(3.0);
    harness.step();
    harness.step();
    assert!((height(&harness) - 3.0).abs() < 1e-6, "{}", height(&harness));
    let eye = harness.state().status()["eye"].clone();
    // The wheel, in the middle of the picture.
    let middle = harness.get_by_label("Picture").rect().center();
    harness.event(eframe::egui::Event::PointerMoved(middle));
    harness.event(eframe::egui::Event::MouseWheel {
        unit: eframe::egui::MouseWheelUnit::Point,
        delta: [0.0, 120.0].into(),
        phase: eframe::egui::TouchPhase::Move,
        source: eframe::egui::MouseWheelSource::Unknown,
        modifiers: eframe::egui::Modifiers::NONE,
    });
    for _ in 0..30 {
        harness.step();
    }
    assert!(height(&harness) < 2.9, "{}", height(&harness));
    assert_eq!(harness.state().status()["eye"], eye, "a wheel in the middle moves no eye");
}
