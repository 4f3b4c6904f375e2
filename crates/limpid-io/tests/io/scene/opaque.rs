//! Opaque bodies, and colours by an attribute of their particles.

use std::path::Path;

use glam::Vec3;
use limpid::liquid::Particles;
use limpid::look::Look;
use limpid::scene::Kind;
use limpid_io::adjustments::Adjustments;
use limpid_io::color_by::{Attribute, ColorRange, MapName};
use limpid_io::input::Input;
use limpid_io::open::Request;
use limpid_io::particles;
use limpid_io::project::Project;

fn scene(liquid: &str) -> limpid_io::Result<Project> {
    let text = format!("[particles]\nsource = \"w_{{}}.npz\"\nradius = 0.1\n[liquid]\n{liquid}\n");
    Project::parse(&text, "scene.toml", Path::new(""))
}

/// Keys of opaque bodies are read, and written so that they are read back.
#[test]
fn opaque_bodies_are_read_and_written() {
    let painted =
        scene("kind = \"opaque\"\ncolor = [0.5, 0.1, 0.0]\nior = 1.5\nroughness = 0.3").unwrap();
    let liquid = painted.scene.liquid;
    assert_eq!((liquid.kind, liquid.ior, liquid.roughness), (Kind::Opaque, 1.5, 0.3));
    assert_eq!((liquid.color, &painted.color_by), (Vec3::new(0.5, 0.1, 0.0), &None));
    // Data are shown by opaque bodies without a coat.
    let colored =
        scene("color_by = \"velocity\"\ncolormap = \"turbo\"\ncolor_range = [1.0, 2.5]").unwrap();
    let by = colored.color_by.clone().unwrap();
    assert_eq!((colored.scene.liquid.kind, colored.scene.liquid.ior), (Kind::Opaque, 1.0));
    assert_eq!(
        (by.attribute, by.map, by.range),
        (Attribute::Velocity, MapName::Turbo, Some([1.0, 2.5]))
    );
    for project in [painted, colored] {
        let text = project.to_toml(None).unwrap();
        let again = Project::parse(&text, "scene.toml", Path::new("")).unwrap();
        assert_eq!((again.scene.liquid, again.color_by), (project.scene.liquid, project.color_by));
    }
}

/// Keys that contradict each other, and values out of range, are errors that say so.
#[test]
fn contradictions_are_told() {
    for (liquid, told) in [
        ("kind = \"opaque\"\nabsorption = [1, 1, 1]", "give its color"),
        ("roughness = 0.2", "kind = \"opaque\""),
        ("kind = \"clear\"\ncolor_by = \"density\"", "color_by colors opaque bodies"),
        ("colormap = \"turbo\"", "need color_by"),
        ("color_by = \"density\"\ncolor = [1, 0, 0]", "one of color and color_by"),
        ("color_by = \"density\"\ncolor_range = [2.0, 1.0]", "the smaller one first"),
        ("kind = \"opaque\"\nior = 0.8", "1 is no coat"),
        ("kind = \"opaque\"\ncolor = [2.0, 0.0, 0.0]", "color must be between 0 and 1"),
        ("color_by = \"id\"\ncolormap = \"turbo\"", "id has no colormap"),
        ("color_by = \"density\"\ncolormap = \"jet\"", "viridis"),
        ("kind = \"milk\"", "opaque"),
    ] {
        let error = scene(liquid).expect_err(liquid).to_string();
        assert!(error.contains(told), "{liquid}: {error}");
    }
}

/// The range of all frames holds for each; a frame without the attribute is an error that names those it has.
#[test]
fn frames_share_a_range() {
    let folder = tempfile::tempdir().unwrap();
    let frame = |speed: f32| Particles {
        velocities: Some((0..200).map(|i| Vec3::X * speed * i as f32 / 199.0).collect()),
        ..Particles::from_positions((0..200).map(|i| Vec3::X * 0.2 * i as f32).collect())
    };
    for (number, speed) in [(1, 1.0), (2, 3.0)] {
        particles::write(&frame(speed), &folder.path().join(format!("w_{number}.npz"))).unwrap();
    }
    let write = |by: &str| {
        let path = folder.path().join("scene.toml");
        let text = format!(
            "[particles]\nsource = \"w_{{}}.npz\"\nradius = 0.1\n[liquid]\ncolor_by = \"{by}\"\n"
        );
        std::fs::write(&path, text).unwrap();
        let (loader, project) = Input::open(path.to_str().unwrap()).unwrap().resolve()?;
        loader.load(&loader.sequence.frames[0], &project.scene)
    };
    let colors = write("velocity").unwrap().splats.colors.unwrap();
    let [low, high] = colors.map().unwrap().range;
    assert!((0.0..0.1).contains(&low) && (2.5..3.0).contains(&high), "{low} to {high}");
    let error = write("density").expect_err("the frames have no density").to_string();
    assert!(error.contains("no `density`") && error.contains("velocity"), "{error}");
}

/// A sequence has one range, that of all its frames, or the given one; files of any other attribute have theirs, with the
/// unit in its name. Several fluids and times between frames keep the values beside the particles.
#[test]
fn sequences_and_fluids_are_colored() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, base: f32| {
        let rows = (0..200).map(|i| format!("{},0,0,{}\n", 0.2 * i as f32, base + i as f32));
        let text = format!("x,y,z,Heat [K]\n{}", rows.collect::<String>());
        std::fs::write(folder.path().join(name), text).unwrap();
    };
    (1..=3u8).for_each(|i| write(&format!("w_{i}.csv"), 100.0 * f32::from(i)));
    let open = |color_range| {
        let adjustments = Adjustments {
            color_by: Some("heat".into()),
            colormap: Some(MapName::Turbo),
            color_range,
            ..Adjustments::default()
        };
        let input = Some(folder.path().join("w_{}.csv"));
        Request { input, radius: Some(0.1), adjustments, ..Request::default() }.open().unwrap()
    };
    let opened = open(None);
    let scene = &opened.project.scene;
    assert_eq!(scene.liquid, Look::paint());
    let scale = opened.loader.color_scale().unwrap().unwrap();
    assert_eq!((scale.name.as_str(), scale.unit.as_str()), ("Heat", "K"));
    // The 12th and the 588th of 600 values.
    assert_eq!((scale.range, scale.automatic), ([112.0, 487.0], true));
    for frame in &opened.loader.sequence.frames {
        let colors = opened.loader.load(frame, scene).unwrap().splats.colors.unwrap();
        assert_eq!(colors.map().unwrap().range, scale.range);
    }
    let half = opened.loader.frame_time(&[1, 2, 3], 1.5).unwrap();
    let between = opened.loader.particles(half).unwrap();
    for (value, position) in between.values.unwrap().iter().zip(&between.positions) {
        assert!((value - (150.0 + position.x / 0.2)).abs() < 1e-2, "{value} at {position}");
    }
    let given = open(Some(ColorRange::Of([0.0, 10.0]))).loader.color_scale().unwrap().unwrap();
    assert_eq!((given.range, given.automatic), ([0.0, 10.0], false));

    // A file that is named alone takes the radius of its sequence, whatever attributes the others have.
    write("v_2.csv", 0.0);
    let bare: String = (0..200).map(|i| format!("{},0,0\n", 0.2 * i as f32)).collect();
    std::fs::write(folder.path().join("v_1.csv"), format!("x,y,z\n{bare}")).unwrap();
    let adjustments = Adjustments { color_by: Some("heat".into()), ..Adjustments::default() };
    let input = Some(folder.path().join("v_2.csv"));
    let alone = Request { input, adjustments, ..Request::default() }.open().unwrap();
    assert!(alone.loader.color_scale().unwrap().is_some());

    // Two fluids.
    write("left.csv", 100.0);
    write("right.csv", 300.0);
    let scene = "[[fluid]]\nsource = \"left.csv\"\nselect = \"heat>150\"\n[[fluid]]\nsource = \"right.csv\"\n\
                 [liquid]\ncolor_by = \"heat\"\n";
    let path = folder.path().join("two.toml");
    std::fs::write(&path, scene).unwrap();
    let (loader, _) = Input::open(&path).unwrap().resolve().unwrap();
    let particles = loader.particles(&loader.sequence.frames[0]).unwrap();
    assert_eq!(particles.len(), 149 + 200);
    let fluids = particles.fluids.unwrap();
    for (i, value) in particles.values.unwrap().iter().enumerate() {
        let base = [100.0, 300.0][usize::from(fluids[i])];
        let expected = base + particles.positions[i].x / 0.2;
        assert!((value - expected).abs() < 1e-2, "{value}, not {expected}");
    }
}

/// Keys of `[liquid]` are replaced by name; those that no longer fit are dropped.
#[test]
fn keys_are_replaced() {
    let set = |overrides: &[&str]| -> limpid_io::Result<Project> {
        let mut project = scene("ior = 1.4\nabsorption = [1, 2, 3]").unwrap();
        project.set(&overrides.iter().map(|&text| text.to_owned()).collect::<Vec<_>>())?;
        Ok(project)
    };
    let heat =
        set(&["liquid.color_by=heat", "liquid.color_range=[20, 80]", "liquid.colormap=magma"]);
    let heat = heat.unwrap();
    let by = heat.color_by.unwrap();
    assert_eq!((by.attribute, by.map), (Attribute::Other("heat".into()), MapName::Magma));
    assert_eq!((by.range, heat.scene.liquid.kind), (Some([20.0, 80.0]), Kind::Opaque));
    let red = set(&["liquid.color_by=heat", "liquid.color=[1, 0, 0]", "liquid.roughness=0.4"]);
    let red = red.unwrap();
    assert_eq!((red.color_by, red.scene.liquid.color), (None, Vec3::X));
    assert_eq!((red.scene.liquid.roughness, red.scene.liquid.ior), (0.4, 1.4));
    for (text, told) in [
        ("liquid.kind=milk", "opaque"),
        ("liquid.roughness=0.4", "kind = \"opaque\""),
        ("liquid.colormap=turbo", "need color_by"),
        ("liquid.shine=1", "liquid.color_by"),
    ] {
        let error = set(&[text]).expect_err(text).to_string();
        assert!(error.contains(text) && error.contains(told), "{error}");
    }
}

/// Opaque fluids among others are read and written, and classified by themselves beside the whole liquid.
#[test]
fn opaque_fluids_are_loaded_beside_the_others() {
    let folder = tempfile::tempdir().unwrap();
    let line = |from: f32| {
        let place = |i| Vec3::new(from + 0.1 * i as f32, 0.0, 0.0);
        Particles::from_positions((0..40).map(place).collect())
    };
    for (name, from) in [("water.csv", 0.0), ("paint.csv", 1.0)] {
        particles::write(&line(from), &folder.path().join(name)).unwrap();
    }
    let of_fluids = |water: &str, paint: &str, liquid: &str| {
        let text = format!(
            "[[fluid]]\nsource = \"water.csv\"\nradius = 0.1\n{water}\n\
             [[fluid]]\nsource = \"paint.csv\"\nradius = 0.1\n{paint}\n[liquid]\n{liquid}\n"
        );
        Project::parse(&text, "scene.toml", folder.path())
    };
    let opaque = "kind = \"opaque\"";
    let color = Vec3::new(0.5, 0.25, 0.0);
    let project = of_fluids("", "kind = \"opaque\"\ncolor = [0.5, 0.25, 0.0]", "").unwrap();
    assert_eq!(project.opaque_fluids, [None, Some(color)]);
    let text = project.to_toml(None).unwrap();
    let again = Project::parse(&text, "scene.toml", Path::new("")).unwrap();
    assert_eq!(again.opaque_fluids, project.opaque_fluids);

    let scene_file = folder.path().join("two.toml");
    std::fs::write(&scene_file, &text).unwrap();
    let (loader, project) = Input::open(scene_file.to_str().unwrap()).unwrap().resolve().unwrap();
    let frame = loader.sequence.frames[0].clone();
    let loaded = loader.load(&frame, &project.scene).unwrap();
    let alone = loaded.splats.opaque.expect("the opaque fluid");
    let splats = alone.aggregates.iter().chain(&alone.splashes);
    let own: Vec<_> = splats.filter(|splat| !splat.is_copy()).collect();
    assert_eq!((loaded.particles, own.len()), (80, 40));
    assert!(alone.colors.is_some());
    assert!(own.iter().all(|splat| splat.fluid() == 1));

    for (water, paint, liquid, told) in [
        ("", "kind = \"opaque\"\nabsorption = [1, 1, 1]", "", "[[fluid]] 2"),
        ("", "kind = \"opaque\"\ncolor = [1.5, 0, 0]", "", "between 0 and 1"),
        (opaque, opaque, "", "all fluids are opaque"),
        ("", opaque, opaque, "the whole [liquid] is opaque"),
    ] {
        let error = of_fluids(water, paint, liquid).expect_err(told).to_string();
        assert!(error.contains(told), "{error}");
    }
}
