//! The pictures that `--skip-existing` skips.

use super::*;

fn all(status: &str) -> BTreeMap<i64, String> {
    [(1, status.to_owned()), (2, status.to_owned())].into()
}

/// A picture is kept only if the run would draw the same one: a change of settings, size, camera,
/// radius, scene, particles or intermediate images draws it again; a change of shares or reports does
/// not.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn only_the_same_picture_is_skipped() {
    if !adapter() {
        return;
    }
    let project = Project::new(2);
    fs::create_dir(project.path("scenes")).unwrap();
    let scene = |color: &str| {
        let text = format!(
            "[environment]\nradiance = {color}\n[camera]\neye = [0.9, 0.8, 1.6]\n\
             target = [0.3, 0.2, 0.2]\nfov_y = 35.0\n"
        );
        fs::write(project.path("scenes/s.toml"), text).unwrap();
    };
    scene("[0.5, 0.6, 0.7]");
    let base = ["-o", "f/", "--skip-existing", "--radius=0.025", "--scene=scenes/s.toml"];
    let run = |more: &[&str]| {
        let args: Vec<_> = base.iter().chain(more).copied().collect();
        project.statuses(&args)
    };
    assert_eq!(run(&[]), all(DONE));
    assert_eq!(run(&[]), all(SKIPPED));

    // Options that do not change the picture: also the order of frames, and other paths to the inputs.
    assert_eq!(run(&["--stats=s.json", "--memory=1", "--frames=2,1", "--claim"]), all(SKIPPED));
    let absolute = project.path("water").display().to_string();
    let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
    let scene_path = format!("--scene={}", project.path("scenes/s.toml").display());
    command.args(["render", "--quiet", &absolute, "--size=48x36", "--radius=0.025", &scene_path]);
    command.args(["--skip-existing", "-o", ".", "--manifest=../absolute.jsonl"]);
    assert_success(command.current_dir(project.path("f")).output().unwrap());
    for line in lines(&project.path("absolute.jsonl")) {
        assert_eq!(text(&line, "status"), SKIPPED);
    }

    // Options that do change it, each applied and reverted.
    let others: [&[&str]; 7] = [
        &["--samples=2"],
        &["--size=40x30"],
        &["--set=liquid.ior=1.2"],
        &["--set=tonemap.exposure=1"],
        &["--camera=eye=1,1,2 target=0.3,0.2,0.2 fov_y=40"],
        &["--preset=imai2016"],
        &["--radius=0.03"],
    ];
    for other in others {
        // An option may be given only once.
        let mut args: Vec<&str> = base.to_vec();
        args.retain(|arg| !(arg.starts_with("--radius") && other[0].starts_with("--radius")));
        args.extend(other);
        let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
        command.args(["render", "--quiet", "water"]).args(&args).current_dir(project.0.path());
        if !other[0].starts_with("--size") {
            command.arg("--size=48x36");
        }
        command.args(["--frames=1", "--manifest=other.jsonl"]);
        assert_success(command.output().unwrap());
        assert_eq!(text(lines(&project.path("other.jsonl")).last().unwrap(), "status"), DONE);
        let expected: BTreeMap<_, _> = [(1, DONE.to_owned()), (2, SKIPPED.to_owned())].into();
        assert_eq!(run(&[]), expected, "{other:?}");
    }
    scene("[0.5, 0.6, 0.8]");
    assert_eq!(run(&[]), all(DONE), "another environment");

    // Other particles: files of another length or modification time.
    project.write_water(1, 10.0);
    let expected: BTreeMap<_, _> = [(1, DONE.to_owned()), (2, SKIPPED.to_owned())].into();
    assert_eq!(run(&[]), expected, "a longer file");
    let file = File::options().write(true).open(project.water(1)).unwrap();
    file.set_modified(SystemTime::now() + Duration::from_secs(1)).unwrap();
    assert_eq!(run(&[]), expected, "a later file");
    assert_eq!(run(&[]), all(SKIPPED));
    // The same name, length and time in another folder.
    fs::rename(project.path("water"), project.path("moved")).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_limpid"));
    command
        .args(["render", "--quiet", "moved", "--size=48x36", "--manifest=moved.jsonl"])
        .args(base);
    assert_success(command.current_dir(project.0.path()).output().unwrap());
    for line in lines(&project.path("moved.jsonl")) {
        assert_eq!(text(&line, "status"), DONE, "other files of the same names");
    }
}

/// A picture that is incomplete or was changed or made by another program, or whose intermediate images
/// are missing, damaged or of another run, is drawn again.
#[test]
#[ignore = "slow: scripts/test.sh --all, and so CI, runs it"]
fn only_complete_pictures_are_skipped() {
    if !adapter() {
        return;
    }
    let project = Project::new(1);
    let run = |more: &[&str]| {
        let args: Vec<_> = ["-o", "f/", "--skip-existing"].iter().chain(more).copied().collect();
        project.statuses(&args)[&1].clone()
    };
    assert_eq!(run(&[]), DONE);
    let path = project.path("f/frame_0001.png");
    let good = fs::read(&path).unwrap();
    let flipped = |at: usize| {
        let mut bytes = good.clone();
        bytes[at] ^= 1;
        bytes
    };
    // A picture edited by another program, which keeps the text chunks.
    let mut retouched = image::load_from_memory(&good).unwrap().into_rgb8();
    retouched.get_pixel_mut(7, 7).0[1] ^= 1;
    let mut edited = Vec::new();
    let mut encoder = png::Encoder::new(&mut edited, 48, 36);
    encoder.set_color(png::ColorType::Rgb);
    let decoder = png::Decoder::new(std::io::Cursor::new(&good)).read_info().unwrap();
    let texts = decoder.info().uncompressed_latin1_text.clone();
    assert_eq!(texts.len(), 3);
    for text in texts {
        encoder.add_text_chunk(text.keyword, text.text).unwrap();
    }
    encoder.write_header().unwrap().write_image_data(&retouched).unwrap();
    let mut plain = std::io::Cursor::new(Vec::new());
    retouched.write_to(&mut plain, image::ImageFormat::Png).unwrap();
    let damaged = [
        ("empty", Vec::new()),
        ("only a header", good[..60].to_vec()),
        ("half", good[..good.len() / 2].to_vec()),
        ("without its end", good[..good.len() - 5].to_vec()),
        ("a flipped bit in the header", flipped(20)),
        ("a flipped bit in the pixels", flipped(good.len() / 2)),
        ("another program's", plain.into_inner()),
        ("edited", edited),
    ];
    for (what, bytes) in damaged {
        fs::write(&path, bytes).unwrap();
        assert_eq!(run(&[]), DONE, "{what}");
        assert!(fs::read(&path).unwrap() == good, "{what}");
    }
    assert_eq!(run(&[]), SKIPPED);

    let aov = "--aov=depth";
    assert_eq!(run(&[aov]), DONE, "no intermediate images");
    let images = project.path("f/frame_0001.aov.exr");
    let good = fs::read(&images).unwrap();
    assert_eq!(run(&[aov]), SKIPPED);
    assert_eq!(run(&[]), SKIPPED);
    assert_eq!(run(&["--aov=depth,inside"]), DONE, "other images");
    for bytes in [&good[..0], &good[..100], &good[..good.len() - 9]] {
        fs::write(&images, bytes).unwrap();
        assert_eq!(run(&[aov]), DONE, "{} of {} bytes", bytes.len(), good.len());
        assert!(fs::read(&images).unwrap() == good);
    }
    // A run with other settings was killed between writing the images and the picture.
    assert_eq!(run(&["--samples=2", aov]), DONE);
    let other = fs::read(&images).unwrap();
    assert_eq!(run(&[aov]), DONE);
    fs::write(&images, other).unwrap();
    assert_eq!(run(&[aov]), DONE, "images of another run");
}
