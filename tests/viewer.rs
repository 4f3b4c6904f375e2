//! The viewer without a window: that it draws what `limpid render` draws, that its panels have every
//! setting, and that what moves the camera and the clock does so by its closed forms.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use eframe::egui::accesskit::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use glam::{DVec2, DVec3, UVec2, Vec3};
use limpid::camera::Camera;
use limpid::gpu::Gpu;
use limpid::input::{Input, Moment};
use limpid::particles::Particles;
use limpid::scene::Scene;
use limpid::settings::Settings;
use limpid::studio::Studio;
use limpid::viewer::command_line::{command_line, quoted};
use limpid::viewer::controls::{CONTROLS, Control, Kind, PASSES, Value, differences};
use limpid::viewer::document::{Document, Source};
use limpid::viewer::draw_thread::{Answer, DrawThread, Pane, Request};
use limpid::viewer::pace::{Level, Pace};
use limpid::viewer::playback::{Playback, Speed};
use limpid::viewer::shortcuts::{POINTER, SHORTCUTS, action};
use limpid::viewer::views::{Legend, View, viridis};
use limpid::viewer::{FINE_SAMPLES, Options, Viewer, rig};

const DATA: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/double_dam_break/");

/// Longest that anything here may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

fn sequence() -> Source {
    let input = format!("{DATA}ParticleData_Fluid_{{}}.bgeo");
    Source { radius: Some(0.025), ..Source::new(input) }
}

/// A viewer in a window of this size that is not there.
fn harness(source: Source, size: [f32; 2]) -> Harness<'static, Viewer> {
    let options = Options { source: Some(source), ..Options::default() };
    let viewer = Viewer::new(options).expect("no log, no error");
    let mut harness = Harness::builder()
        .with_size(size)
        .build_ui_state(|ui, viewer: &mut Viewer| viewer.ui(ui), viewer);
    until(&mut harness, "something is open", |viewer| viewer.command_line("x").is_some());
    harness
}

#[track_caller]
fn until(
    harness: &mut Harness<'static, Viewer>,
    what: &str,
    mut come: impl FnMut(&Viewer) -> bool,
) {
    let begun = Instant::now();
    while !come(harness.state()) {
        assert!(begun.elapsed() < PATIENCE, "not in time: {what}");
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
    }
    harness.step();
}

/// Runs a command as a shell does, with this limpid, in a folder.
fn shell(command: &str, folder: &Path) {
    let program = Path::new(env!("CARGO_BIN_EXE_limpid"));
    let path = format!(
        "{}:{}",
        program.parent().expect("a program is in a folder").display(),
        std::env::var("PATH").unwrap_or_default()
    );
    let mut sh = assert_cmd::Command::new("sh");
    sh.current_dir(folder).env("PATH", path).args(["-c", command]).assert().success();
}

// ---- One code path.

/// Protects "the viewer and `render` are one code path": what the draw thread shows is, bit by bit,
/// what a studio draws; at a frame, between two, and with another setting.
#[test]
fn draw_thread_and_studio_draw_the_same_bits() {
    let input = Input::open(&sequence().input, &[]).expect("the frames are there");
    let input = input.with_radius(0.025).expect("a radius");
    let (input, scene) = input.settle(&[]).expect("it settles");
    let gpu = Gpu::headless().expect("an adapter");
    let mut studio = Studio::new(&gpu);
    let (sender, answers) = mpsc::channel();
    let thread = DrawThread::new(move |answer| sender.send(answer).expect("the test waits"));
    let between = Moment { frame: 20, next: 21, fraction: 0.5 };
    let set = |text: &str| vec![text.to_owned()];
    let cases = [
        (Moment::at(20), vec![]),
        (between, vec![]),
        (Moment::at(40), set("refract.solver=march")),
        (Moment::at(40), set("classify.short_axis=1.1")),
    ];
    let mut pictures = Vec::new();
    for (number, (at, overrides)) in (1..).zip(cases) {
        let settings = scene.settings.with(&overrides).expect("settings");
        let scene = Scene { settings, ..scene.clone() };
        let loaded = std::sync::Arc::new(input.load(at, &scene).expect("it loads"));
        let camera = scene.camera_for(loaded.bounds);
        let size = UVec2::new(160, 120);
        let shot = studio.draw(&scene, &camera, &loaded.splats, size).expect("it draws");
        let pane = Pane { scene: scene.into(), camera, loaded, size };
        let request =
            Request { number, panes: vec![pane], level: Level::Full, view: View::Picture };
        thread.request(request);
        let drawn = loop {
            if let Answer::Drawn(drawn) = answers.recv_timeout(PATIENCE).expect("an answer") {
                break drawn.expect("it draws");
            }
        };
        assert_eq!(drawn.number, number);
        let shown = drawn.panes[0].image.pixels.iter().flat_map(|c| [c.r(), c.g(), c.b()]);
        assert!(shown.eq(shot.picture.as_raw().iter().copied()), "moment {at:?} {overrides:?}");
        pictures.push(shot.picture);
    }
    // The cases are not one and the same picture.
    assert!((1..pictures.len()).all(|i| pictures[i] != pictures[i - 1]));
}

/// Protects *copy the command line*: run by a shell, it writes the very bytes that the viewer saves;
/// with a setting, a liquid and a view of the user's own, between two frames.
#[test]
fn copied_command_line_writes_what_the_viewer_saves() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut source = sequence();
    source.overrides = vec!["smooth.iterations=2".into(), "liquid.ior=1.41".into()];
    source.frames = Some("20-21".parse().expect("frames"));
    let mut harness = harness(source, [420.0, 300.0]);
    // Half speed has moments between frames.
    harness.key_press(eframe::egui::Key::OpenBracket);
    harness.key_press(eframe::egui::Key::ArrowRight);
    harness.key_press(eframe::egui::Key::F);
    harness.step();
    harness.step();
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    let command = harness.state().command_line("rendered.png").expect("something is open");
    assert!(command.contains("--at=20.5") && command.contains("smooth.iterations=2"), "{command}");
    let (path, size) = (folder.path().join("saved.png"), harness.state().picture_size());
    harness.state_mut().save_picture(path, size, FINE_SAMPLES);
    until(&mut harness, "the picture is saved", |viewer| {
        viewer.notices().iter().any(|notice| notice.text.starts_with("saved"))
    });
    shell(&command, folder.path());
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).expect("a picture");
    assert!(bytes("saved.png") == bytes("rendered.png"), "{command}");
}

/// Protects *settings saved to a scene file that `render` draws alike*.
#[test]
fn saved_scene_renders_as_the_command_line_does() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut source = sequence();
    source.frames = Some("40".parse().expect("a frame"));
    source.overrides = vec!["classify.wetting=0".into()];
    let mut harness = harness(source, [420.0, 300.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    harness.state().save_scene(&folder.path().join("s.toml")).expect("it is saved");
    shell(&harness.state().command_line("a.png").expect("open"), folder.path());
    let UVec2 { x, y } = harness.state().picture_size();
    shell(&format!("limpid render s.toml --frames 40 --size {x}x{y} -o b.png"), folder.path());
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).expect("a picture");
    assert!(bytes("a.png") == bytes("b.png"));
}

// ---- Panels.

/// A viewer high enough for all settings, with all their sections open.
fn all_settings() -> Harness<'static, Viewer> {
    let scene = Source::new(concat!(env!("CARGO_MANIFEST_DIR"), "/sims/slab.toml"));
    let mut harness = harness(scene, [1000.0, 2400.0]);
    for title in ["Particles to splats", "Light from the lights", "Radiance to picture"] {
        harness.get_by_label(title).click();
        harness.run_ok();
    }
    for _ in 0..30 {
        harness.step();
    }
    harness
}

/// The control's widget among those of the same name: passes have settings of one name.
fn index_among_equals(control: &Control) -> usize {
    let before = CONTROLS.iter().take_while(|c| c.path() != control.path());
    before.filter(|c| c.label == control.label).count()
}

fn role(control: &Control) -> Role {
    match control.kind {
        Kind::Number(..) | Kind::Whole(..) | Kind::Odd(..) => Role::Slider,
        Kind::Toggle => Role::CheckBox,
        Kind::Choice(_) => Role::ComboBox,
    }
}

/// Protects that every setting is in its panel, that the widget changes that setting and no other,
/// that this is what is drawn, and that a pass can be reset.
#[test]
fn every_setting_has_a_control_that_changes_it_alone() {
    let mut harness = all_settings();
    let opened = harness.state().scenes()[0].settings.clone();
    for control in &CONTROLS {
        let path = control.path();
        let node = || {
            let all = harness.query_all_by_role_and_label(role(control), control.label);
            all.into_iter().nth(index_among_equals(control))
        };
        let node = node().unwrap_or_else(|| panic!("no control for {path}"));
        match control.kind {
            Kind::Number(low, high, _) => {
                node.set_value_accesskit(0.25 * low + 0.05 * high.min(99.0) + 0.01);
            }
            Kind::Whole(low, high, _) => {
                node.set_value_accesskit(f64::from(if low + 1 == high { low } else { low + 2 }));
            }
            Kind::Odd(..) => node.set_value_accesskit(9.0),
            Kind::Toggle => node.click_accesskit(),
            Kind::Choice(_) => node.click_accesskit(),
        }
        harness.step();
        if let Kind::Choice(names) = control.kind {
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
        assert!(command.contains(&path), "{path} is drawn: {command}");
        harness.get_by_label(&format!("Reset {}", control.pass)).click_accesskit();
        harness.step();
        harness.step();
        assert_eq!(harness.state().scenes()[0].settings, opened, "{path} is reset");
    }
}

/// Protects the liquid's controls, presets and *reset all*.
#[test]
fn liquid_and_presets_change_and_reset() {
    let mut harness = all_settings();
    let opened = harness.state().scenes()[0].clone();
    harness.get_by_role_and_label(Role::Slider, "Index").set_value_accesskit(1.5);
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
    let expected = opened.settings.with(&["preset=imai2016".into()]).expect("a preset");
    assert_eq!(harness.state().scenes()[0].settings, expected);
    // The other settings are others.
    assert_eq!(harness.state().scenes()[1], opened);
    harness.get_by_label("Copy A to B").click_accesskit();
    harness.step();
    assert_eq!(harness.state().scenes()[1].settings, expected);
    harness.get_by_label("Reset all").click_accesskit();
    harness.step();
    harness.step();
    assert_eq!(harness.state().scenes()[0], opened);
}

/// Protects the list of keys: `?` shows each shortcut and what the pointer does.
#[test]
fn question_mark_lists_every_key() {
    let mut harness = harness(sequence(), [1280.0, 800.0]);
    assert!(harness.query_by_label(SHORTCUTS[0].help).is_none());
    harness.key_press_modifiers(eframe::egui::Modifiers::SHIFT, eframe::egui::Key::Slash);
    harness.step();
    harness.step();
    let texts = SHORTCUTS.iter().flat_map(|s| [s.shown, s.help]);
    for text in texts.chain(POINTER.iter().flat_map(|&(how, what)| [how, what])) {
        assert!(harness.query_all_by_label(text).next().is_some(), "{text} is listed");
    }
}

/// Protects playback by key, and view modes by key: each is shown with what its colours mean.
#[test]
fn keys_play_step_and_switch_views() {
    use eframe::egui::Key;
    let mut harness = harness(sequence(), [700.0, 400.0]);
    let count = harness.state().playback().count();
    assert_eq!(count, 5);
    harness.key_press(Key::ArrowRight);
    harness.step();
    assert_eq!(harness.state().playback().index(), 1);
    harness.key_press(Key::End);
    harness.step();
    assert_eq!(harness.state().playback().index(), count - 1);
    harness.key_press(Key::Home);
    harness.key_press(Key::Space);
    harness.step();
    assert!(harness.state().playback().playing);
    until(&mut harness, "two frames have played", |viewer| viewer.playback().index() >= 2);
    harness.key_press(Key::Space);
    harness.step();
    assert!(!harness.state().playback().playing);
    let views: Vec<View> = View::all().collect();
    for view in views.iter().skip(1).chain(&views[..1]) {
        harness.key_press(Key::V);
        harness.step();
        assert_eq!(harness.state().view(), *view);
    }
    harness.key_press(Key::V);
    until(&mut harness, "depth at rest", Viewer::is_at_rest);
    harness.get_by_label("Depth, m");
}

/// Protects *a damaged frame is a visible notice, and playback goes on*.
#[test]
fn damaged_frame_is_told_and_playback_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    for number in 1..=4 {
        let path = folder.path().join(format!("w_{number}.bgeo"));
        let positions = (0..40).map(|i| Vec3::new(0.05 * i as f32, 0.0, 0.1)).collect();
        Particles { positions, ..Default::default() }.write(&path).expect("it is written");
    }
    std::fs::write(folder.path().join("w_2.bgeo"), b"not particles").expect("it is damaged");
    let source = Source { radius: Some(0.03), ..Source::new(folder.path().display().to_string()) };
    let mut harness = harness(source, [700.0, 400.0]);
    harness.key_press(eframe::egui::Key::Space);
    until(&mut harness, "frame 4", |viewer| viewer.playback().index() == 3);
    let notices = harness.state().notices();
    assert!(notices.iter().any(|n| n.error && n.text.contains("w_2.bgeo")), "{notices:?}");
    let shown = notices.last().expect("there is one").text.clone();
    harness.get_by_label(&shown);
    harness.get_by_label("Dismiss").click_accesskit();
    harness.step();
    harness.step();
    assert!(harness.state().notices().is_empty());
}

/// Protects simulated scenes: what is not there yet is made while the rest plays, and what is there
/// is not made again.
#[test]
fn simulation_is_made_while_it_plays() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("drip.toml");
    let text = "[simulation]\nframes = 7\nradius = 0.05\n\
                bounds = { min = [-1.0, 0.0, -1.0], max = [1.0, inf, 1.0] }\n\
                [[simulation.block]]\nmin = [-0.3, 0.1, -0.3]\nmax = [0.3, 0.6, 0.3]\n";
    std::fs::write(&path, text).expect("it is written");
    let source = Source::new(path.display().to_string());
    let mut harness = harness(source.clone(), [700.0, 400.0]);
    until(&mut harness, "all frames", |viewer| viewer.playback().count() == 7);
    until(&mut harness, "it plays", |viewer| viewer.playback().index() > 0);
    assert!(harness.state().playback().playing && harness.state().notices().is_empty());
    let made = |number: u32| {
        let frame = limpid::sim::frame_path(&limpid::sim::folder(&path), "drip", number);
        std::fs::metadata(frame).expect("a frame").modified().expect("a time")
    };
    let before = made(7);
    drop(harness);
    let harness = self::harness(source, [700.0, 400.0]);
    assert_eq!((harness.state().playback().count(), made(7)), (7, before));
}

/// Protects opening by what cannot be opened: a notice, and what was open stays.
#[test]
fn what_cannot_be_opened_is_told() {
    let mut harness = harness(sequence(), [700.0, 400.0]);
    harness.state_mut().open(Source::new("/nowhere/at_all.bgeo"));
    until(&mut harness, "a notice", |viewer| !viewer.notices().is_empty());
    assert!(harness.state().notices()[0].text.contains("/nowhere/at_all.bgeo"));
    assert!(harness.state().command_line("x").is_some());
}

/// Protects a window without a size, as a minimised one has: nothing is drawn, nothing fails, and
/// the picture comes back.
#[test]
fn window_without_size_draws_nothing() {
    let mut harness = harness(sequence(), [700.0, 400.0]);
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
    for size in [[0.0, 0.0], [1.0, 1.0], [700.0, 5.0], [700.0, 400.0]] {
        harness.set_size(size.into());
        for _ in 0..3 {
            harness.step();
        }
    }
    until(&mut harness, "a picture at rest", Viewer::is_at_rest);
}

/// Protects key frames: they are added at the present time, in order, once for each time.
#[test]
fn camera_keys_are_added_in_order_of_time() {
    use eframe::egui::Key;
    let mut harness = harness(sequence(), [1000.0, 700.0]);
    for key in [Key::End, Key::K, Key::Home, Key::K, Key::K] {
        harness.key_press(key);
        harness.step();
    }
    let times: Vec<f64> = harness.state().path().keys.iter().map(|key| key.time).collect();
    // Frames 5 to 40 at 30 a second.
    assert_eq!(times, [0.0, 35.0 / 30.0]);
    harness.get_by_label("Camera").click_accesskit();
    harness.step();
    harness.step();
    harness.get_by_label("Delete key 1").click_accesskit();
    harness.step();
    harness.step();
    assert_eq!(harness.state().path().keys.len(), 1);
}

// ---- The table of settings.

/// Protects the one table of settings: it names every field of the settings, once; its ranges are
/// those of `Settings::check`, to the last step; its choices are all that there are.
#[test]
fn controls_are_the_settings() {
    let table = toml::Table::try_from(Settings::default()).expect("a table");
    let fields: BTreeSet<String> = table
        .iter()
        .flat_map(|(pass, all)| {
            let all = all.as_table().expect("a table of each pass");
            all.keys().map(move |key| format!("{pass}.{key}"))
        })
        .collect();
    let controls: BTreeSet<String> = CONTROLS.iter().map(Control::path).collect();
    assert_eq!(controls.len(), CONTROLS.len(), "none is there twice");
    assert_eq!(controls, fields);
    let passes: BTreeSet<&str> = PASSES.iter().map(|(pass, _)| *pass).collect();
    assert_eq!(passes, table.keys().map(String::as_str).collect());

    for control in &CONTROLS {
        let with = |value: String| {
            let settings = Settings::default().with(&[format!("{}={value}", control.path())]);
            settings.and_then(|settings| settings.check().map(|()| settings))
        };
        let path = control.path();
        match control.kind {
            Kind::Number(low, high, _) => {
                let (low, high) = (low as f32, high as f32);
                assert!(
                    with(format!("{low:?}")).is_ok() && with(format!("{high:?}")).is_ok(),
                    "{path}"
                );
                let (below, above) = (low.next_down(), high.next_up());
                assert!(with(format!("{below:?}")).is_err(), "{path} below {low}");
                assert!(with(format!("{above:?}")).is_err(), "{path} above {high}");
            }
            Kind::Whole(low, high, _) | Kind::Odd(low, high, _) => {
                assert!(with(low.to_string()).is_ok() && with(high.to_string()).is_ok(), "{path}");
                assert!(low == 0 || with((low - 1).to_string()).is_err(), "{path} below {low}");
                assert!(with((high + 1).to_string()).is_err(), "{path} above {high}");
                let odd = matches!(control.kind, Kind::Odd(..));
                assert_eq!(with((low + 1).to_string()).is_err(), odd, "{path}: odd numbers only");
            }
            Kind::Toggle => {
                let Value::Toggle(_) = control.get(&Settings::default()) else {
                    panic!("{path} is no toggle")
                };
            }
            Kind::Choice(names) => {
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

/// Protects `--set` on the copied command line: every value that a setting may have is given
/// exactly.
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
    assert_eq!(Settings::default().with(&overrides).expect("settings"), settings);
}

// ---- Command lines and scene files.

/// Protects words of a command line against a shell: it gets them as they were.
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

/// Protects the arguments that a command line is made of: only what differs, and the camera exactly.
#[test]
fn command_line_tells_what_differs() {
    let source = sequence();
    let document = Document::open(&source).expect("it opens");
    let camera = document.scene.camera.expect("it is settled");
    let size = UVec2::new(64, 48);
    let plain = command_line(&document, &document.scene, &camera, Moment::at(20), size, "a b.png");
    assert!(!plain.contains("--set"), "{plain}");
    assert!(plain.contains("--frames=20") && plain.ends_with("-o 'a b.png'"), "{plain}");
    let written = plain.split("--camera='").nth(1).and_then(|rest| rest.split('\'').next());
    assert_eq!(written.expect("a camera").parse::<Camera>().expect("a camera"), camera);
}

/// Protects `--camera`: what is written is read as the same camera, to the last bit; what is no
/// camera is refused with what is wrong.
#[test]
fn camera_survives_its_text() {
    let camera = Camera {
        eye: DVec3::new(0.1 + 0.2, -1.0 / 3.0, 1e-17),
        target: DVec3::new(1e4, -0.0, 5.5),
        up: Vec3::new(0.1, 0.9, -0.3),
        fov_y: 38.7,
        near: Some(0.1),
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

// ---- Time.

/// Protects that every moment is shown once, in order, and that one which is not there is waited for.
#[test]
fn playback_waits_and_leaves_nothing_out() {
    let mut playback = Playback::new(4, 30.0);
    playback.playing = true;
    let frame = 1.0 / 30.0;
    assert!(!playback.advance(0.4 * frame, |_| true));
    assert!(playback.advance(0.7 * frame, |_| true));
    assert_eq!(playback.index(), 1);
    // Frame 2 is late by a second: then it is shown, and 3 no sooner than a frame's time after.
    for _ in 0..30 {
        assert!(!playback.advance(frame, |i| i != 2));
    }
    assert!(playback.advance(0.01 * frame, |_| true));
    assert_eq!(playback.index(), 2);
    assert!(!playback.advance(0.5 * frame, |_| true));
    assert!(playback.advance(0.6 * frame, |_| true));
    assert_eq!(playback.index(), 3);
    assert!(playback.advance(frame, |_| true));
    assert_eq!(playback.index(), 0, "it is looped");
    playback.looped = false;
    playback.backwards = true;
    playback.advance(frame, |_| true);
    assert!(!playback.playing, "it ends at the end");
}

/// Protects speeds: slow motion has more moments of the same frames, fast motion leaves some out,
/// and a change of speed stays where it is.
#[test]
fn speeds_keep_the_time() {
    let count = |frames: usize, speed: Speed| ((frames - 1) as f64 / speed.step()) as usize + 1;
    let mut playback = Playback::new(count(9, Speed::Real), 25.0);
    playback.seek(5);
    playback.set_speed(Speed::Quarter, count(9, Speed::Quarter));
    assert_eq!((playback.index(), playback.count()), (20, 33));
    playback.set_speed(Speed::Double, count(9, Speed::Double));
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

// ---- The camera.

/// Cameras of all scales, near the poles too.
fn cameras() -> Vec<Camera> {
    let views =
        [DVec3::new(0.3, 0.5, 1.0), DVec3::new(1e-4, 1.0, 0.0), DVec3::new(-1.0, -3.0, 0.2)];
    let scales = [1e-3, 1.0, 1e4];
    let camera = |scale: f64, view: DVec3| Camera {
        eye: scale * (view + DVec3::new(0.1, 0.2, 0.3)),
        target: scale * DVec3::new(0.1, 0.2, 0.3),
        up: Vec3::Y,
        fov_y: 40.0,
        near: None,
    };
    scales.into_iter().flat_map(|scale| views.map(|view| camera(scale, view))).collect()
}

fn close(a: DVec3, b: DVec3, scale: f64) -> bool {
    (a - b).length() <= 1e-9 * scale
}

/// Protects orbits: the distance stays, the target stays, a turn around is none, small turns add
/// up, and over the poles it does not flip.
#[test]
fn orbit_keeps_distance_and_horizon() {
    for camera in cameras() {
        let distance = camera.eye.distance(camera.target);
        let turned = rig::orbit(&camera, DVec2::new(0.7, 0.0));
        assert_eq!(turned.target, camera.target);
        assert!((turned.eye.distance(turned.target) / distance - 1.0).abs() < 1e-12);
        let around = rig::orbit(&camera, DVec2::new(std::f64::consts::TAU, 0.0));
        assert!(close(around.eye, rig::orbit(&camera, DVec2::ZERO).eye, distance));
        let thrice = (0..3).fold(camera, |c, _| rig::orbit(&c, DVec2::new(0.1, 0.01)));
        assert!(close(thrice.eye, rig::orbit(&camera, DVec2::new(0.3, 0.03)).eye, 1e3 * distance));
        // Far over the pole: the eye stays on its side, and the picture upright.
        for up in [9.0, -9.0] {
            let top = rig::orbit(&camera, DVec2::new(0.0, up));
            top.check().expect("it is a view");
            let [right, above, _] = rig::axes(&top);
            let [before, ..] = rig::axes(&rig::orbit(&camera, DVec2::ZERO));
            assert!(above.y > 0.0 && right.dot(before) > 0.999, "{camera:?}");
        }
    }
}

/// Protects pans (eye and target move alike, by what is seen), zooms (exponential, the pointer's
/// place stays) and flights.
#[test]
fn pan_zoom_and_fly_have_their_closed_forms() {
    for camera in cameras() {
        let distance = camera.eye.distance(camera.target);
        let [right, up, back] = rig::axes(&camera);
        let height = 2.0 * distance * 20f64.to_radians().tan();
        let panned = rig::pan(&camera, DVec2::new(0.25, -0.5));
        let moved = height * (0.25 * right - 0.5 * up);
        assert!(close(panned.eye - camera.eye, moved, distance));
        assert!(close(panned.target - camera.target, moved, distance));

        let near = rig::zoom(&camera, 0.5, DVec2::ZERO);
        assert!(close(near.target, camera.target, distance));
        assert!((near.eye.distance(near.target) / distance - (-0.5f64).exp()).abs() < 1e-9);
        let back_again = rig::zoom(&near, -0.5, DVec2::ZERO);
        assert!(close(back_again.eye, camera.eye, distance));
        let cursor = DVec2::new(0.6, -0.3);
        let at_cursor = |c: &Camera| {
            let [right, up, _] = rig::axes(c);
            let half = c.eye.distance(c.target) * 20f64.to_radians().tan();
            c.target + half * (cursor.x * right + cursor.y * up)
        };
        let zoomed = rig::zoom(&camera, 0.8, cursor);
        assert!(close(at_cursor(&zoomed), at_cursor(&camera), 10.0 * distance));

        let flown = rig::fly(&camera, distance * DVec3::new(0.0, 0.0, 0.5));
        assert!(close(flown.eye, camera.eye - 0.5 * distance * back, distance));
        assert!((flown.eye.distance(flown.target) / distance - 1.0).abs() < 1e-9);
        let looked = rig::look(&camera, DVec2::new(0.2, 0.0));
        assert_eq!(looked.eye, camera.eye);
        assert!((looked.target - camera.target).dot(right) > 0.0, "to the right");
    }
}

/// Protects *fit*: all of the box is in the picture, and fills it, whatever its scale and shape.
#[test]
fn fit_shows_all_of_the_box() {
    for scale in [1e-3, 1.0, 1e4] {
        for (half, aspect) in [(DVec3::new(1.0, 0.1, 0.4), 1.6), (DVec3::new(0.2, 2.0, 0.2), 0.7)] {
            let centre = scale * DVec3::new(5.0, -2.0, 1.0);
            let (min, max) = (centre - scale * half, centre + scale * half);
            for camera in cameras() {
                let fitted = rig::fit(&camera, (min, max), aspect);
                fitted.check().expect("it is a view");
                let [right, up, back] = rig::axes(&fitted);
                let tangent = 20f64.to_radians().tan();
                let reach = (0..8).map(|i| {
                    let pick = |bit: u32, axis: usize| {
                        if i >> bit & 1 == 0 { min[axis] } else { max[axis] }
                    };
                    let corner = DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2)) - fitted.eye;
                    let depth = -corner.dot(back);
                    assert!(depth > 0.0);
                    let x = corner.dot(right).abs() / (depth * tangent * aspect);
                    x.max(corner.dot(up).abs() / (depth * tangent))
                });
                let reach = reach.fold(0.0, f64::max);
                assert!(reach <= 1.0 && reach > 0.8, "{reach}");
            }
        }
    }
}

// ---- Pace, views, keys.

/// Protects responsiveness: a slow machine gets drafts that it can draw in time, however the time
/// depends on the size; a fast one gets full pictures; and neither wavers.
#[test]
fn drafts_are_as_large_as_time_allows() {
    let full = UVec2::new(1280, 800);
    /// Milliseconds by the share of the full picture.
    type Cost = fn(f64) -> f64;
    let machines: [(&str, Cost, f64); 4] = [
        ("fast", |area| 2.0 + 8.0 * area, 1.0),
        ("slow", |area| 5.0 + 400.0 * area, 0.25),
        ("slow whatever the size", |area| 130.0 + area, 1.0),
        ("very slow", |area| 20_000.0 * area, 0.125),
    ];
    for (name, ms, expected) in machines {
        let mut pace = Pace::default();
        assert!(pace.draft(full).x < full.x, "nothing is known yet");
        let mut scales = Vec::new();
        for _ in 0..40 {
            let size = pace.draft(full);
            let area = f64::from(size.element_product()) / f64::from(full.element_product());
            pace.measured(size, full, ms(area));
            scales.push(pace.scale());
        }
        assert_eq!(scales.last(), Some(&expected), "{name}: {scales:?}");
        assert!(scales[20..].iter().all(|scale| *scale == expected), "{name} wavers: {scales:?}");
    }
    let mut pace = Pace::default();
    pace.measured(UVec2::ZERO, full, 10.0);
    pace.measured(full, UVec2::ZERO, 10.0);
    assert_eq!(pace.draft(UVec2::ONE), UVec2::ONE);
}

/// Protects view modes: the legend's ends are the colours' ends, normals are colours, and an image
/// that a frame does not have is told.
#[test]
fn views_have_legends_that_fit() {
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
    assert_ne!(image.pixels[0], viridis(0.0), "empty is no depth");

    let (image, legend, _) = View::Image(Aov::Normal, 0).shown(&parts, size);
    assert_eq!(legend, Legend::Normal);
    assert_eq!((image.pixels[1].r(), image.pixels[3].r(), image.pixels[2].g()), (255, 0, 255));

    let (image, legend, values) = View::Image(Aov::Depth, 2).shown(&parts, size);
    assert!(matches!(legend, Legend::Nothing(_)) && values.is_none());
    assert_eq!(image.size, [4, 1]);
    let names: BTreeSet<_> = View::all().map(View::label).collect();
    assert_eq!(names.len(), 1 + Aov::ALL.len());
}

/// Protects the keys: no two are one, each is found by its press, and with Ctrl it is another.
#[test]
fn each_key_does_one_thing() {
    use eframe::egui::{Key, Modifiers};
    let keys: BTreeSet<_> = SHORTCUTS.iter().map(|s| (s.key, s.command)).collect();
    assert_eq!(keys.len(), SHORTCUTS.len());
    for shortcut in &SHORTCUTS {
        let with = if shortcut.command { Modifiers::COMMAND } else { Modifiers::NONE };
        assert_eq!(action(shortcut.key, with), Some(shortcut.action));
    }
    assert_eq!(action(Key::F, Modifiers::COMMAND), None);
    assert_ne!(action(Key::L, Modifiers::COMMAND), action(Key::L, Modifiers::NONE));
    assert_eq!(action(Key::Slash, Modifiers::SHIFT), action(Key::Questionmark, Modifiers::NONE));
}

/// Protects names and times of what is open: a title without folders, and seconds by frame numbers.
#[test]
fn documents_have_short_names_and_times() {
    let document = Document::open(&sequence()).expect("it opens");
    assert_eq!(document.name(), "ParticleData_Fluid_{}.bgeo");
    assert_eq!(document.seconds(Moment { frame: 20, next: 40, fraction: 0.5 }), 25.0 / 30.0);
    assert!(PathBuf::from(&document.source.input).is_absolute());
}
