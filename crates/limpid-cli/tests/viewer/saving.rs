//! Saving: nothing is overwritten without a question, under a path that is seen, at a size that is chosen.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;

use eframe::egui::accesskit::Role;
use eframe::egui::{Key, Modifiers};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};
use glam::UVec2;
use image::codecs::png::PngDecoder;
use image::{AnimationDecoder as _, Frame, GenericImageView as _, RgbaImage};
use limpid_io::adjustments::{Adjustments, Floor};
use limpid_viewer::Viewer;
use limpid_viewer::model::document::Source;

use super::{harness, sequence, until, until_saved, wait};

/// Opens a dialog by its key.
fn open_dialog(harness: &mut Harness<'static, Viewer>, key: Key) {
    harness.key_press_modifiers(Modifiers::COMMAND, key);
    for _ in 0..3 {
        harness.step();
    }
}

/// Presses a button of the dialog.
fn press(harness: &mut Harness<'static, Viewer>, name: &str) {
    harness.get_by_role_and_label(Role::Button, name).click_accesskit();
    for _ in 0..3 {
        harness.step();
    }
}

fn shown_path(harness: &Harness<'static, Viewer>) -> String {
    harness.get_by_role_and_label(Role::TextInput, "Path").value().unwrap_or_default()
}

fn type_path(harness: &mut Harness<'static, Viewer>, path: &Path) {
    harness.get_by_role_and_label(Role::TextInput, "Path").focus();
    harness.step();
    harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    harness.step();
    let text = path.display().to_string();
    harness.get_by_role_and_label(Role::TextInput, "Path").type_text(&text);
    harness.step();
    harness.step();
    assert_eq!(shown_path(harness), text);
}

/// The dialog shows the whole path, a file is replaced only after a question, and the notice names the whole path.
#[test]
fn files_are_replaced_after_a_question() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("mine.png");
    image::RgbImage::new(2, 3).save(&path).expect("it is written");
    let mine = fs::read(&path).expect("a file");
    let mut harness = harness(sequence(), [700.0, 400.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    open_dialog(&mut harness, Key::S);
    let proposed = shown_path(&harness);
    assert!(Path::new(&proposed).is_absolute() && !Path::new(&proposed).exists(), "{proposed}");
    type_path(&mut harness, &path);
    press(&mut harness, "Save");
    assert_eq!(fs::read(&path).expect("a file"), mine);
    let asks = |harness: &Harness<'static, Viewer>| {
        harness.query_all_by_label_contains("exists. Replace it").next().is_some()
    };
    assert!(asks(&harness));
    // Another name needs no question.
    type_path(&mut harness, &folder.path().join("other.png"));
    assert!(!asks(&harness));
    type_path(&mut harness, &path);
    press(&mut harness, "Replace");
    until_saved(&mut harness);
    assert_ne!(image::open(&path).expect("a picture").dimensions(), (2, 3));
    let text = format!("saved {}", path.display());
    assert!(harness.state().notices().iter().any(|notice| notice.text == text));
    // The next picture goes beside it, under a name that is free.
    open_dialog(&mut harness, Key::S);
    assert_eq!(Path::new(&shown_path(&harness)).parent(), Some(folder.path()));
}

/// Usual sizes are a press away, the ratio is kept, and the background may be left out.
#[test]
fn sizes_keep_their_ratio_and_backgrounds_may_be_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("small.png");
    // A ground would fill the picture.
    let adjustments = Adjustments { floor: Some(Floor::None), ..Adjustments::default() };
    let mut harness = harness(Source { adjustments, ..sequence() }, [900.0, 600.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    open_dialog(&mut harness, Key::S);
    let size = |harness: &Harness<'static, Viewer>| {
        ["Width, pixels", "Height, pixels"].map(|name| {
            let node = harness.get_by_role_and_label(Role::SpinButton, name);
            node.accesskit_node().numeric_value().expect("a number")
        })
    };
    for (name, expected) in
        [("1080p", [1920.0, 1080.0]), ("4K", [3840.0, 2160.0]), ("Square", [1080.0; 2])]
    {
        press(&mut harness, name);
        assert_eq!(size(&harness), expected, "{name}");
    }
    press(&mut harness, "1080p");
    harness.get_by_role_and_label(Role::SpinButton, "Width, pixels").set_value_accesskit(96.0);
    harness.step();
    harness.step();
    assert_eq!(size(&harness), [96.0, 54.0]);
    harness.get_by_label("Transparent background").click_accesskit();
    harness.step();
    type_path(&mut harness, &path);
    press(&mut harness, "Save");
    until_saved(&mut harness);
    let picture = image::open(&path).expect("a picture");
    assert_eq!(picture.dimensions(), (96, 54));
    let alphas: Vec<u8> = picture.to_rgba8().pixels().map(|pixel| pixel.0[3]).collect();
    assert!(alphas.contains(&0) && alphas.contains(&255), "no background is left out");
}

/// A film has the pictures between the marks of the timeline, as the film of all has them, and the dialog says so.
#[test]
fn films_are_between_the_marks() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut harness = harness(sequence(), [900.0, 600.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let film = |harness: &mut Harness<'static, Viewer>, name: &str| {
        let path = folder.path().join(name);
        harness.state_mut().save_film(path.clone(), UVec2::new(96, 64), 1);
        let is_saved = |viewer: &Viewer| {
            viewer.notices().iter().any(|n| n.text.starts_with("saved") && n.text.ends_with(name))
        };
        until(harness, "it is saved", is_saved);
        pictures(&path)
    };
    let all = film(&mut harness, "all.apng");
    for key in [Key::ArrowRight, Key::I, Key::End, Key::ArrowLeft, Key::O] {
        harness.key_press(key);
        harness.step();
    }
    assert_eq!(harness.state().playback().marked(), Some([1, 3]));
    let marked = film(&mut harness, "marked.apng");
    assert_eq!((all.len(), marked.len()), (5, 3));
    assert!(all[0] != all[1], "the pictures are alike");
    assert!(marked[..] == all[1..4], "other pictures than those between the marks");
    open_dialog(&mut harness, Key::M);
    harness.get_by_label("3 frames between the marks, 0.10 s at 30 frames per second");
}

/// The pictures of a film.
fn pictures(path: &Path) -> Vec<RgbaImage> {
    let file = BufReader::new(File::open(path).expect("a film"));
    let film = PngDecoder::new(file).expect("a film").apng().expect("a film");
    let frames = film.into_frames().collect_frames().expect("pictures");
    frames.into_iter().map(Frame::into_buffer).collect()
}

/// The dialog of films tells frames, length and rate; the progress tells the time that is left.
#[test]
fn films_tell_length_and_time_left() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut harness = harness(sequence(), [900.0, 600.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let size = harness.state().picture_size();
    open_dialog(&mut harness, Key::M);
    harness.get_by_label("5 frames, 0.17 s at 30 frames per second");
    type_path(&mut harness, &folder.path().join("film.apng"));
    press(&mut harness, "Save");
    wait(&mut harness, "the time left", |harness| {
        assert_eq!(harness.state().picture_size(), size, "the progress resizes the picture");
        harness.query_by_label_contains(" left").is_some()
    });
    until_saved(&mut harness);
}
