//! Looking at data as users of visualisation programs do: views along axes, typed frames, marks, undo, values of particles,
//! and panels on small windows.

use eframe::egui::accesskit::Role;
use eframe::egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::DVec3;
use limpid_viewer::Viewer;
use limpid_viewer::model::document::Source;

use super::{assert_command_line_writes_what_is_saved, harness, sequence, show_tab, until, wait};

fn slab() -> Source {
    Source::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../sims/slab.toml"))
}

fn press(harness: &mut Harness<'static, Viewer>, key: Key) {
    harness.key_press(key);
    harness.step();
    harness.step();
}

fn eye(harness: &Harness<'static, Viewer>) -> DVec3 {
    serde_json::from_value(harness.state().status()["eye"].clone()).expect("a place")
}

fn command(viewer: &Viewer) -> String {
    viewer.command_line("x").expect("something is open")
}

/// Keys and the ends of the axes in the corner look along the axes, and show the whole liquid.
#[test]
fn views_are_along_the_axes() {
    let mut harness = harness(sequence(), [1000.0, 700.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let mut eyes = Vec::new();
    for (key, end) in [(Key::Num2, "From +x"), (Key::Num3, "From +y"), (Key::Num1, "From +z")] {
        press(&mut harness, key);
        let by_key = eye(&harness);
        press(&mut harness, Key::H);
        harness.get_by_label(end).click_accesskit();
        harness.step();
        harness.step();
        assert!(eye(&harness).distance(by_key) < 1e-9, "{end}");
        eyes.push(by_key);
    }
    let [x, y, z] = eyes[..] else { unreachable!() };
    let middle = DVec3::new(z.x, x.y, x.z);
    for (seen, axis) in [(x, DVec3::X), (y, DVec3::Y), (z, DVec3::Z)] {
        let direction = (seen - middle).normalize();
        assert!(direction.dot(axis) > 0.999, "{direction} instead of {axis}");
    }
}

/// A typed number goes to its frame, or the nearest one.
#[test]
fn frames_are_typed() {
    let mut harness = harness(sequence(), [1000.0, 700.0]);
    for (typed, index) in [(21.0, 2), (37.0, 4), (5.0, 0), (-3.0, 0)] {
        harness.get_by_role_and_label(Role::SpinButton, "Frame").set_value_accesskit(typed);
        harness.step();
        harness.step();
        assert_eq!(harness.state().playback().index(), index, "{typed}");
    }
}

/// Playback stays between the marks, at every speed; the same keys remove them.
#[test]
fn marks_limit_playback() {
    let mut harness = harness(sequence(), [1000.0, 700.0]);
    let span = |harness: &Harness<'static, Viewer>| harness.state().playback().span();
    for key in [Key::ArrowRight, Key::I, Key::End, Key::ArrowLeft, Key::O] {
        press(&mut harness, key);
    }
    assert_eq!(span(&harness), [1, 3]);
    assert_eq!(harness.state().playback().following(), Some(1));
    // Half the speed: frames 5, 20, 21, 22 and 40 with those between.
    press(&mut harness, Key::OpenBracket);
    let playback = harness.state().playback();
    assert!(playback.count() > 5 && playback.span()[0] > 0, "{playback:?}");
    press(&mut harness, Key::CloseBracket);
    assert_eq!(span(&harness), [1, 3]);
    press(&mut harness, Key::O);
    assert_eq!(span(&harness), [1, 4]);
    harness.get_by_label("In").click_accesskit();
    harness.step();
    harness.step();
    assert_eq!(span(&harness), [3, 4]);
    press(&mut harness, Key::I);
    assert_eq!(harness.state().playback().marked(), None);
}

/// Changes of settings and of the look are taken back one by one, and made again.
#[test]
fn changes_are_taken_back() {
    let mut harness = harness(sequence(), [1000.0, 900.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    harness.get_by_label("Ground").click_accesskit();
    harness.step();
    until(&mut harness, "no ground", |viewer| command(viewer).contains("--floor=none"));
    show_tab(&mut harness, "Settings");
    harness.get_by_role_and_label(Role::Slider, "Refractive index").set_value_accesskit(1.5);
    harness.step();
    harness.step();
    let index = |harness: &Harness<'static, Viewer>| harness.state().scenes()[0].liquid.ior;
    assert_eq!(index(&harness), 1.5);
    harness.get_by_label("Undo").click_accesskit();
    harness.step();
    harness.step();
    assert_eq!(index(&harness), 1.33);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::Z);
    harness.step();
    until(&mut harness, "the ground", |viewer| !command(viewer).contains("--floor"));
    for _ in 0..2 {
        harness.step();
        harness.key_press_modifiers(Modifiers::COMMAND, Key::Y);
        harness.step();
        until(&mut harness, "no ground again", |viewer| command(viewer).contains("--floor=none"));
    }
    assert_eq!(index(&harness), 1.5);
}

/// A click on the picture shows the values of the particle there.
#[test]
fn clicks_show_values_of_particles() {
    let mut harness = harness(slab(), [1000.0, 700.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    assert!(harness.query_by_label("Particle").is_none());
    press(&mut harness, Key::F);
    let middle = harness.get_by_role_and_label(Role::Image, "Picture").rect().center();
    harness.hover_at(middle);
    harness.step();
    harness.drag_at(middle);
    harness.step();
    harness.drop_at(middle);
    harness.step();
    wait(&mut harness, "a particle", |harness| harness.query_by_label("Particle").is_some());
    harness.get_by_label("Close").click_accesskit();
    harness.step();
    harness.step();
    assert!(harness.query_by_label("Particle").is_none());
}

/// Plain particles are a kind of liquid: the program draws the same, and other kinds have their settings back.
#[test]
fn particles_are_shown_plainly() {
    let mut harness = harness(sequence(), [1000.0, 900.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let opened = harness.state().scenes()[0].clone();
    show_tab(&mut harness, "Settings");
    let kind = |harness: &mut Harness<'static, Viewer>, name: &str| {
        // A list stays open until something is clicked with a pointer.
        if harness.query_by_role_and_label(Role::Button, name).is_none() {
            harness.get_by_role_and_label(Role::ComboBox, "Kind").click_accesskit();
            harness.step();
            harness.step();
        }
        harness.get_by_role_and_label(Role::Button, name).click_accesskit();
        harness.step();
        harness.step();
    };
    kind(&mut harness, "plain particles");
    let scene = &harness.state().scenes()[0];
    assert!(scene.is_opaque() && scene.settings.smooth.iterations == 0);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    assert_command_line_writes_what_is_saved(&mut harness);
    harness.step();
    kind(&mut harness, "clear");
    assert_eq!(harness.state().scenes()[0], opened);
}

/// A small window is all picture: the panel comes when it is asked for. The icons stay on the right.
#[test]
fn small_windows_are_all_picture() {
    let mut harness = harness(sequence(), [800.0, 500.0]);
    assert!(harness.state().picture_size().x > 780);
    for icon in ["Panels", "Undo", "Theme", "Keys"] {
        let place = harness.get_by_label(icon).rect();
        assert!(place.max.x <= 800.0 && place.min.x > 600.0, "{icon}: {place:?}");
    }
    harness.get_by_label("Panels").click_accesskit();
    harness.step();
    harness.step();
    harness.get_by_label("Camera");
    harness.get_by_label("Panels").click_accesskit();
    harness.step();
    harness.step();
    assert!(harness.query_by_label("Camera").is_none());
    harness.set_size([1000.0, 500.0].into());
    harness.step();
    harness.step();
    harness.get_by_label("Camera");
}

/// Beside each other A and B are whole: half as wide and half as high.
#[test]
fn pictures_beside_each_other_are_whole() {
    let mut harness = harness(sequence(), [1000.0, 700.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    harness.get_by_label("Side by side").click_accesskit();
    harness.step();
    harness.step();
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let size = harness.state().picture_size() / 2;
    assert_eq!(harness.state().status()["shown"]["size"], serde_json::json!(size.to_array()));
}

/// The table of times has the colours of the lines.
#[test]
fn times_have_the_colors_of_the_plot() {
    let mut harness = harness(sequence(), [1000.0, 900.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    show_tab(&mut harness, "Times");
    for pass in ["splat", "gaps", "smooth", "refract", "tonemap"] {
        harness.get_by_label(&format!("Color of {pass}"));
    }
}

/// A plane leaves the particles on one side of it; the camera stays, and the program draws the same.
#[test]
fn planes_cut_the_liquid() {
    let mut harness = harness(sequence(), [1000.0, 900.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let count = |viewer: &Viewer| viewer.status()["particles"].as_u64().expect("a number");
    let (all, before) = (count(harness.state()), eye(&harness));
    harness.get_by_role_and_label(Role::ComboBox, "Clip").click_accesskit();
    harness.step();
    harness.step();
    harness.get_by_role_and_label(Role::Button, "x").click_accesskit();
    harness.step();
    until(&mut harness, "a plane", |viewer| command(viewer).contains("--select='x<="));
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let below = count(harness.state());
    assert!((1..all).contains(&below), "{below} of {all}");
    harness.get_by_label("below").click_accesskit();
    harness.step();
    until(&mut harness, "the other side", |viewer| command(viewer).contains("--select='x>="));
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    assert_eq!(below + count(harness.state()), all);
    assert_eq!(eye(&harness), before);
    assert_command_line_writes_what_is_saved(&mut harness);
}
