//! Colours by data and kinds of liquid in the panels: what is listed, that pictures, films and scenes are those of the
//! program, and what is refused.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use eframe::egui::accesskit::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::{UVec2, Vec3};
use limpid::scene::Kind;
use limpid_io::adjustments::Adjustments;
use limpid_io::color_by::{Attribute, MapName};
use limpid_io::media::MediumName;
use limpid_io::project::Project;
use limpid_viewer::model::document::Source;
use limpid_viewer::{Options, Viewer};

use super::{
    assert_command_line_writes_what_is_saved, harness, same_picture, sequence, shell, show_tab,
    shown, until, wait,
};

/// Writes a flat body as VTU, whose temperature rises by 20 K a metre from 20 K on, and whose pressure is the same all
/// over.
fn write_vtu(path: &Path) {
    let (mut points, mut heat, mut count) = (String::new(), String::new(), 0);
    for i in 0..25 * 4 * 20 {
        let [x, y, z] = [i % 25, i / 25 % 4, i / 100].map(|i| i as f32 * 0.125);
        write!(points, "{x} {y} {z} ").unwrap();
        write!(heat, "{} ", 20.0 + 20.0 * x).unwrap();
        count += 1;
    }
    let scalars = |name: &str, values: &str| {
        format!("<DataArray type=\"Float32\" Name=\"{name}\" format=\"ascii\">{values}</DataArray>")
    };
    let text = format!(
        "<?xml version=\"1.0\"?><VTKFile type=\"UnstructuredGrid\" version=\"1.0\">\
         <UnstructuredGrid><Piece NumberOfPoints=\"{count}\" NumberOfCells=\"0\"><PointData>{}{}\
         </PointData><Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">\
         {points}</DataArray></Points><Cells>\
         <DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\"></DataArray>\
         <DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\"></DataArray>\
         <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\"></DataArray></Cells>\
         </Piece></UnstructuredGrid></VTKFile>",
        scalars("Temperature [K]", &heat),
        scalars("Pressure", &"7 ".repeat(count)),
    );
    fs::write(path, text).expect("it is written");
}

fn flat(folder: &Path) -> Source {
    let path = folder.join("flat.vtu");
    write_vtu(&path);
    Source { radius: Some(0.07), ..Source::new(path.to_string_lossy()) }
}

/// Chooses an item of a combo box, once it is listed.
fn choose(harness: &mut Harness<'static, Viewer>, name: &str, item: &str) {
    let is_listed = |harness: &Harness<'static, Viewer>| {
        harness.query_by_role_and_label(Role::Button, item).is_some()
    };
    // A list stays open until something is clicked with a pointer.
    if !is_listed(harness) {
        harness.get_by_role_and_label(Role::ComboBox, name).click_accesskit();
    }
    wait(harness, item, is_listed);
    harness.get_by_role_and_label(Role::Button, item).click_accesskit();
    harness.step();
    harness.step();
}

fn set(harness: &mut Harness<'static, Viewer>, role: Role, name: &str, value: f64) {
    harness.get_by_role_and_label(role, name).set_value_accesskit(value);
    harness.step();
    harness.step();
}

/// Waits until this file is saved, whatever was saved before.
fn until_file(harness: &mut Harness<'static, Viewer>, name: &str) {
    until(harness, name, |viewer| {
        let is_it = |text: &str| text.starts_with("saved") && text.ends_with(name);
        viewer.notices().iter().any(|notice| is_it(&notice.text))
    });
}

fn at_rest(harness: &mut Harness<'static, Viewer>) {
    harness.step();
    until(harness, "a picture at rest", Viewer::is_at_rest);
}

fn command(harness: &Harness<'static, Viewer>) -> String {
    harness.state().command_line("x.png").expect("something is open")
}

/// The panel lists a file's attributes with their values. One of them makes the look paint, and the program draws the same
/// picture, here and by another map and range, which need no particles again. Ranges that fall are refused.
#[test]
fn attributes_color_as_in_the_program() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut harness = harness(flat(folder.path()), [900.0, 1500.0]);
    at_rest(&mut harness);
    harness.get_by_role_and_label(Role::ComboBox, "Color by").click_accesskit();
    for item in ["none", "Temperature, 20 to 80 K", "Pressure, 7", "x", "y", "z"] {
        wait(&mut harness, item, |harness| {
            harness.query_by_role_and_label(Role::Button, item).is_some()
        });
    }
    harness.key_press(eframe::egui::Key::Escape);
    harness.step();
    choose(&mut harness, "Color by", "Temperature, 20 to 80 K");
    until(&mut harness, "colors", |viewer| viewer.colors().scale.is_some());
    at_rest(&mut harness);
    let scale = harness.state().colors().scale.clone().expect("a scale");
    assert_eq!((scale.name.as_str(), scale.unit.as_str()), ("Temperature", "K"));
    assert!(scale.automatic && scale.range[0] >= 20.0 && scale.range[1] <= 80.0, "{scale:?}");
    assert!(command(&harness).contains("--color-by=Temperature"), "{}", command(&harness));
    assert!(harness.state().scenes()[0].is_opaque());
    assert_command_line_writes_what_is_saved(&mut harness);

    choose(&mut harness, "Color map", "turbo");
    set(&mut harness, Role::SpinButton, "From", 30.0);
    set(&mut harness, Role::SpinButton, "To", 45.5);
    let by = harness.state().colors().by.clone().expect("an attribute");
    assert_eq!((by.map, by.range), (MapName::Turbo, Some([30.0, 45.5])));
    at_rest(&mut harness);
    let told = command(&harness);
    for part in ["liquid.colormap=turbo", "liquid.color_range=[30.0, 45.5]"] {
        assert!(told.contains(part), "{told}");
    }
    assert_command_line_writes_what_is_saved(&mut harness);

    set(&mut harness, Role::SpinButton, "To", 12.0);
    let notices = harness.state().notices();
    let refused = |text: &str| text.contains("from 30 to 12") && text.contains("smaller one first");
    assert!(notices.iter().any(|notice| notice.error && refused(&notice.text)), "{notices:?}");
    assert_eq!(harness.state().colors().by.as_ref(), Some(&by));
    harness.get_by_role_and_label(Role::CheckBox, "Usual range").click_accesskit();
    harness.step();
    harness.step();
    assert_eq!(harness.state().colors().scale.as_ref().map(|scale| scale.range), Some(scale.range));

    choose(&mut harness, "Color by", "none");
    until(&mut harness, "no colors", |viewer| viewer.colors().by.is_none());
    assert!(!harness.state().scenes()[0].is_opaque());
    assert!(!command(&harness).contains("--color"), "{}", command(&harness));
}

/// A viewer that is opened with a range knows the usual one once it is asked for.
#[test]
fn usual_ranges_are_found_later() {
    let folder = tempfile::tempdir().expect("a folder");
    let adjustments = Adjustments {
        color_by: Some(Attribute::from("temperature")),
        color_range: "25:60".parse().ok(),
        ..Adjustments::default()
    };
    let source = Source { adjustments, ..flat(folder.path()) };
    let mut harness = harness(source, [900.0, 1500.0]);
    at_rest(&mut harness);
    let range = |viewer: &Viewer| viewer.colors().scale.as_ref().map(|scale| scale.range);
    assert_eq!(range(harness.state()), Some([25.0, 60.0]));
    harness.get_by_role_and_label(Role::CheckBox, "Usual range").click_accesskit();
    harness.step();
    until(&mut harness, "the usual range", |viewer| {
        viewer.colors().scale.as_ref().is_some_and(|scale| scale.automatic)
    });
    let [low, high] = range(harness.state()).expect("a range");
    assert!((20.0..25.0).contains(&low) && (75.0..=80.0).contains(&high), "{low} to {high}");
    at_rest(&mut harness);
    assert_command_line_writes_what_is_saved(&mut harness);
}

/// The legend is in saved pictures and films as the program draws it, and pictures that are too small for it are told.
#[test]
fn legends_are_saved() {
    let folder = tempfile::tempdir().expect("a folder");
    let adjustments = Adjustments { color_by: Some(Attribute::Velocity), ..Adjustments::default() };
    let source = Source { adjustments, ..sequence() };
    let options = Options { source: Some(source), legend: true, ..Options::default() };
    let viewer = Viewer::new(options).expect("a viewer");
    let mut harness = shown(viewer, [900.0, 700.0]);
    at_rest(&mut harness);
    let told = command(&harness);
    assert!(told.contains("--legend") && told.contains("--color-by=velocity"), "{told}");
    assert_command_line_writes_what_is_saved(&mut harness);
    let UVec2 { x, y } = harness.state().picture_size();
    harness.state_mut().save_picture(folder.path().join("with.png"), UVec2::new(x, y), 1);
    until_file(&mut harness, "with.png");
    shell(&command(&harness).replace("--legend", ""), folder.path());
    let [with, without] = ["with.png", "x.png"]
        .map(|name| image::open(folder.path().join(name)).expect("a picture").into_rgb8());
    let corner = |picture: &image::RgbImage| {
        let part = image::imageops::crop_imm(picture, x - 60, 20, 40, 60).to_image();
        part.into_raw()
    };
    assert_ne!(corner(&with), corner(&without));

    harness.state_mut().save_picture(folder.path().join("small.png"), UVec2::new(64, 48), 1);
    let small = "no legend is drawn: pictures of 64 x 48 are too small for it";
    assert!(harness.state().notices().iter().any(|notice| notice.text == small));
    harness.state_mut().save_film(folder.path().join("saved.apng"), UVec2::new(240, 200), 1);
    until_file(&mut harness, "saved.apng");
    let camera = told.split_once("--camera='").and_then(|(_, rest)| rest.split_once('\''));
    let camera = camera.expect("a camera").0;
    let input = sequence().input;
    shell(
        &format!(
            "limpid render '{input}' --radius=0.025 '--camera={camera}' --size 240x200 --fps 30 \
             --color-by velocity --legend -o rendered.apng"
        ),
        folder.path(),
    );
    let read = |name: &str| fs::read(folder.path().join(name)).expect("a film");
    assert!(read("saved.apng") == read("rendered.apng"));
}

/// Every kind of liquid and every medium is chosen in the panel, with its properties; the command line draws it, and a
/// saved scene has it.
#[test]
fn kinds_of_liquid_are_chosen() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut harness = harness(flat(folder.path()), [900.0, 1500.0]);
    at_rest(&mut harness);
    show_tab(&mut harness, "Settings");
    let saved = |harness: &mut Harness<'static, Viewer>, name: &str| {
        harness.state_mut().save_scene(folder.path().join(name));
        until_file(harness, name);
        Project::load(&folder.path().join(name)).expect("a scene")
    };
    let liquid = |viewer: &Viewer| viewer.scenes()[0].liquid;
    choose(&mut harness, "Kind", "turbid");
    assert!(harness.state().scenes()[0].is_turbid());
    set(&mut harness, Role::Slider, "Scattering, red", 12.5);
    set(&mut harness, Role::Slider, "Anisotropy", 0.5);
    at_rest(&mut harness);
    assert_eq!(
        (liquid(harness.state()).scattering.x, liquid(harness.state()).anisotropy),
        (12.5, 0.5)
    );
    assert_command_line_writes_what_is_saved(&mut harness);
    let turbid = liquid(harness.state());
    assert_eq!(saved(&mut harness, "turbid.toml").scene.liquid, turbid);

    choose(&mut harness, "Medium", "coffee");
    let coffee = liquid(harness.state());
    assert_eq!(coffee.ior, MediumName::Coffee.ior());
    let share = coffee.scattering / MediumName::Coffee.medium().scattering;
    assert!((share / share.x - 1.0).abs().max_element() < 1e-5, "{coffee:?}");

    choose(&mut harness, "Kind", "opaque");
    assert!(harness.query_by_role_and_label(Role::Slider, "Scattering, red").is_none());
    set(&mut harness, Role::Slider, "Roughness", 0.25);
    set(&mut harness, Role::Slider, "Color, green", 0.75);
    at_rest(&mut harness);
    let paint = liquid(harness.state());
    assert_eq!((paint.kind, paint.roughness, paint.color.y), (Kind::Opaque, 0.25, 0.75));
    assert_command_line_writes_what_is_saved(&mut harness);
    assert_eq!(saved(&mut harness, "paint.toml").scene.liquid, paint);

    choose(&mut harness, "Kind", "clear");
    assert_eq!(
        (liquid(harness.state()).kind, liquid(harness.state()).scattering),
        (Kind::Clear, Vec3::ZERO)
    );
    assert!(!command(&harness).contains("liquid."), "{}", command(&harness));
}

/// A scene that is saved has the colours that are shown.
#[test]
fn saved_scenes_have_their_colors() {
    let folder = tempfile::tempdir().expect("a folder");
    let adjustments =
        Adjustments { color_by: Some(Attribute::from("temperature")), ..Adjustments::default() };
    let source = Source { adjustments, ..flat(folder.path()) };
    let mut harness = harness(source, [900.0, 1500.0]);
    at_rest(&mut harness);
    choose(&mut harness, "Color map", "magma");
    set(&mut harness, Role::SpinButton, "To", 50.0);
    at_rest(&mut harness);
    harness.state_mut().save_scene(folder.path().join("s.toml"));
    until_file(&mut harness, "s.toml");
    let project = Project::load(&folder.path().join("s.toml")).expect("a scene");
    let by = project.color_by.expect("an attribute");
    assert_eq!(Some(&by), harness.state().colors().by.as_ref());
    assert_eq!((by.map, by.range.map(|range| range[1])), (MapName::Magma, Some(50.0)));
    let UVec2 { x, y } = harness.state().picture_size();
    shell(&command(&harness), folder.path());
    shell(&format!("limpid render s.toml --size {x}x{y} -o b.png"), folder.path());
    assert!(same_picture(folder.path(), "x.png", "b.png"));
}
