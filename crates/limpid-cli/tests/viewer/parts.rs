//! Parts of the viewer: playback, the size of drafts, views and their legends, shortcuts, and documents.

use std::collections::BTreeSet;
use std::path::PathBuf;

use glam::{DVec3, UVec2};
use limpid::camera::Camera;
use limpid::scene::Scene;
use limpid_io::input::FrameTime;
use limpid_io::shared_classifier::Processor;
use limpid_viewer::model::document::Document;
use limpid_viewer::model::playback::{Playback, Speed};
use limpid_viewer::model::shortcuts::{SHORTCUTS, action};
use limpid_viewer::model::views::{Legend, View, viridis};
use limpid_viewer::picture::adaptive_resolution::AdaptiveResolution;
use limpid_viewer::picture::flipbook::{Flipbook, Moment, Subject, Viewpoint};

use super::sequence;

/// Every frame time is shown once, in order, and playback waits for those not loaded yet.
#[test]
fn playback_waits_and_skips_nothing() {
    let mut playback = Playback::new(4, 30.0);
    playback.playing = true;
    let frame = 1.0 / 30.0;
    assert!(!playback.advance(0.4 * frame, |_| true));
    assert!(playback.advance(0.7 * frame, |_| true));
    assert_eq!(playback.index(), 1);
    // Frame 2 is late by a second; frame 3 is shown no sooner than a frame's duration after it.
    for _ in 0..30 {
        assert!(!playback.advance(frame, |i| i != 2));
    }
    assert!(playback.advance(0.01 * frame, |_| true));
    assert_eq!(playback.index(), 2);
    assert!(!playback.advance(0.5 * frame, |_| true));
    assert!(playback.advance(0.6 * frame, |_| true));
    assert_eq!(playback.index(), 3);
    assert!(playback.advance(frame, |_| true));
    assert_eq!(playback.index(), 0, "playback does not loop");
    playback.looped = false;
    playback.backwards = true;
    playback.advance(frame, |_| true);
    assert!(!playback.playing, "playback does not stop at the end");
}

/// Playback stays between marks, in both directions, and comes to them from outside; marks at both ends are none.
#[test]
fn marks_are_the_ends_of_playback() {
    let mut playback = Playback::new(10, 25.0);
    playback.mark(Some([3, 6]));
    let mut next = |index: usize, backwards: bool| {
        playback.seek(index);
        playback.backwards = backwards;
        playback.following()
    };
    assert_eq!([0, 3, 5, 6, 9].map(|i| next(i, false)), [3, 4, 6, 3, 3].map(Some));
    assert_eq!([0, 3, 5, 6, 9].map(|i| next(i, true)), [6, 6, 4, 5, 6].map(Some));
    playback.set_count(5);
    assert_eq!(playback.marked(), Some([3, 4]));
    playback.mark(Some([0, 4]));
    assert_eq!(playback.marked(), None);
    playback.seek(2);
    playback.mark_last();
    playback.seek(4);
    playback.mark_first();
    assert_eq!(playback.marked(), None, "it begins after it has ended");
}

/// Slow motion has more frame times for the same frames, fast motion skips some; a change of speed keeps
/// the time.
#[test]
fn speeds_keep_the_time() {
    let count = |frames: usize, speed: Speed| ((frames - 1) as f64 / speed.step()) as usize + 1;
    let mut playback = Playback::new(count(9, Speed::Real), 25.0);
    playback.seek(5);
    playback.set_speed(Speed::Quarter, count(9, Speed::Quarter), 20);
    assert_eq!((playback.index(), playback.count()), (20, 33));
    playback.set_speed(Speed::Double, count(9, Speed::Double), 5);
    assert_eq!((playback.index(), playback.following()), (5, Some(7)));
    assert_eq!(playback.step(), 2);
    playback.seek(8);
    assert_eq!(playback.following(), Some(0));
    playback.backwards = true;
    playback.seek(1);
    assert_eq!((playback.following(), playback.step()), (Some(8), -2));
    playback.seek(100);
    assert_eq!(playback.index(), 8);
    playback.step_by(true);
    assert_eq!(playback.index(), 0);
    playback.step_by(false);
    assert_eq!(playback.index(), 8);
    for (i, speed) in Speed::ALL.into_iter().enumerate() {
        assert_eq!(speed.next(true), Speed::ALL[(i + 1).min(5)]);
        assert_eq!(speed.next(false), Speed::ALL[i.saturating_sub(1)]);
    }
    let mut nothing = Playback::new(0, 25.0);
    nothing.playing = true;
    nothing.advance(1.0, |_| true);
    nothing.step_by(true);
    assert_eq!(nothing.index(), 0);
}

/// Drafts are small enough to be drawn in time on a slow machine, whatever its cost per pixel, but no smaller
/// than a quarter each way, and full pictures on a fast one; the size does not oscillate.
#[test]
fn drafts_are_as_large_as_time_allows() {
    let full = UVec2::new(1280, 800);
    /// Milliseconds as a function of the share of the full picture's area.
    type Cost = fn(f64) -> f64;
    let machines: [(&str, Cost, f64); 4] = [
        ("fast", |area| 2.0 + 8.0 * area, 1.0),
        ("slow", |area| 5.0 + 400.0 * area, 0.25),
        ("slow whatever the size", |area| 130.0 + area, 1.0),
        ("very slow", |area| 20_000.0 * area, 0.25),
    ];
    for (name, ms, expected) in machines {
        let mut resolution = AdaptiveResolution::default();
        assert!(resolution.draft(full).x < full.x, "full size before any measurement");
        let mut scales = Vec::new();
        for _ in 0..40 {
            let size = resolution.draft(full);
            let area = f64::from(size.element_product()) / f64::from(full.element_product());
            resolution.measured(size, full, ms(area));
            scales.push(resolution.scale());
        }
        assert_eq!(scales.last(), Some(&expected), "{name}: {scales:?}");
        assert!(
            scales[20..].iter().all(|scale| *scale == expected),
            "{name} oscillates: {scales:?}"
        );
    }
    let mut resolution = AdaptiveResolution::default();
    resolution.measured(UVec2::ZERO, full, 10.0);
    resolution.measured(full, UVec2::ZERO, 10.0);
    assert_eq!(resolution.draft(UVec2::ONE), UVec2::ONE);
}

/// A flipbook keeps pictures by subject and moment within its budget: books that were not used lately make room,
/// and what does not fit is not kept.
#[test]
fn flipbook_keeps_within_its_budget() {
    let camera = Camera::fit(-DVec3::ONE, DVec3::ONE);
    let subject = |width: u32| Subject {
        scenes: vec![Scene::default()],
        size: UVec2::new(width, 1),
        view: View::Picture,
        processor: Processor::Cpu,
        viewpoint: Viewpoint::Fixed(camera),
        scale: None,
    };
    let at = |frame: i64| Moment::from(FrameTime::at(frame));
    let held = |book: &Flipbook<u32>, width: u32| -> Vec<bool> {
        book.holds(&subject(width), (1..=4).map(at)).collect()
    };
    let mut book = Flipbook::new(40);
    for frame in 1..=3 {
        book.keep(&subject(1), at(frame), frame as u32, 10);
    }
    assert_eq!((book.get(&subject(1), at(2)), book.get(&subject(2), at(2))), (Some(&2), None));
    assert_eq!(held(&book, 1), [true, true, true, false]);
    // A better picture of the same moment takes the place of the first.
    book.keep(&subject(1), at(2), 20, 12);
    assert_eq!((book.get(&subject(1), at(2)), book.bytes()), (Some(&20), 32));
    // Another subject needs the memory.
    book.keep(&subject(2), at(1), 5, 30);
    assert_eq!((held(&book, 1), book.bytes()), (vec![false; 4], 30));
    book.keep(&subject(2), at(2), 6, 11);
    assert_eq!(held(&book, 2), [true, false, false, false]);
    assert!(book.is_full(&subject(2)) && !book.is_full(&subject(1)));
    let mut none = Flipbook::new(0);
    none.keep(&subject(1), at(1), 1, 10);
    assert!(none.is_full(&subject(1)) && none.bytes() == 0);
    // Between frames, the fraction counts.
    let between = |fraction| Moment::from(FrameTime { frame: 1, next: 2, fraction });
    assert_ne!(between(0.25), between(0.5));
}

/// A legend has the range of its colours, normals are shown as colours, and an image missing from a
/// frame is reported.
#[test]
fn legends_match_their_views() {
    use limpid::aov::{Aov, Channel, Part};
    let channel = |name: &str, values: Vec<f32>| Channel { name: name.into(), values };
    let size = UVec2::new(4, 1);
    let part = Part {
        name: "limpid".into(),
        size,
        channels: vec![
            channel("iterations", vec![0.0, 2.0, 4.0, 8.0]),
            channel("depth.aggregate_front", vec![0.0, 1.0, 2.0, 3.0]),
            channel("normal.aggregate_front.X", vec![0.0, 1.0, 0.0, -1.0]),
            channel("normal.aggregate_front.Y", vec![0.0, 0.0, 1.0, 0.0]),
            channel("normal.aggregate_front.Z", vec![0.0; 4]),
        ],
    };
    let parts = [part];
    let (image, legend, values) = View::Image(Aov::Iterations, 0).shown(&parts, size);
    let Legend::Scale { low: 0.0, high: 8.0, .. } = legend else { panic!("{legend:?}") };
    assert_eq!((image.pixels[0], image.pixels[3]), (viridis(0.0), viridis(1.0)));
    assert_eq!(values.expect("numbers").at(0.6, 0.5), Some(vec![4.0]));

    let (image, legend, _) = View::Image(Aov::Depth, 0).shown(&parts, size);
    assert!(matches!(legend, Legend::Scale { low: 1.0, high: 3.0, unit: "m", .. }), "{legend:?}");
    assert_ne!(image.pixels[0], viridis(0.0), "empty has the colour of a depth");

    let (image, legend, _) = View::Image(Aov::Normal, 0).shown(&parts, size);
    assert_eq!(legend, Legend::Normal);
    assert_eq!((image.pixels[1].r(), image.pixels[3].r(), image.pixels[2].g()), (255, 0, 255));

    let (image, legend, values) = View::Image(Aov::Depth, 2).shown(&parts, size);
    assert!(matches!(legend, Legend::Nothing(_)) && values.is_none());
    assert_eq!(image.size, [4, 1]);
    let names: BTreeSet<_> = View::all().map(View::label).collect();
    let shown = Aov::ALL.into_iter().filter(|aov| !aov.is_for_compositing());
    assert_eq!(names.len(), 1 + shown.count());
}

/// Shortcuts are distinct, each key finds its action, and Ctrl makes it another shortcut.
#[test]
fn shortcuts_are_distinct() {
    use eframe::egui::{Key, Modifiers};
    let keys: BTreeSet<_> = SHORTCUTS.iter().map(|s| (s.key, s.command)).collect();
    assert_eq!(keys.len(), SHORTCUTS.len());
    for shortcut in &SHORTCUTS {
        let modifiers = if shortcut.command { Modifiers::COMMAND } else { Modifiers::NONE };
        assert_eq!(action(shortcut.key, modifiers), Some(shortcut.action));
    }
    assert_eq!(action(Key::F, Modifiers::COMMAND), None);
    assert_ne!(action(Key::L, Modifiers::COMMAND), action(Key::L, Modifiers::NONE));
    assert_eq!(action(Key::Slash, Modifiers::SHIFT), action(Key::Questionmark, Modifiers::NONE));
}

/// A document's name omits its folders, and its times follow the frame numbers.
#[test]
fn names_and_times_of_documents() {
    let document = Document::open(&sequence()).expect("it opens");
    assert_eq!(document.name(), "ParticleData_Fluid_{}.bgeo");
    assert_eq!(document.seconds(FrameTime { frame: 20, next: 40, fraction: 0.5 }), 25.0 / 30.0);
    assert!(PathBuf::from(&document.source.input).is_absolute());
}
