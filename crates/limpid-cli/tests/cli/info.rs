//! `info`: descriptions of particle files as text and as JSON.

use serde_json::Value;

use super::{assert_contains, dam, folder, project, succeed};

/// The text lists frames, particles, arrays and radius of the first frame, or of the selected ones.
#[test]
fn info_as_text() {
    let folder = folder();
    let text = succeed(folder.path(), &["info", &dam("{}")]);
    assert_contains(&text, &["5 frames", "5 to 40", "frame 5", "4732 particles"]);
    assert_contains(&text, &["velocity", "density", "id", "radius"]);
    assert_contains(&text, &["  used: id (4732), ", "velocity (4732, 3)"]);
    assert!(!text.contains("frame 20:"), "only the first frame is described: {text}");
    let text = succeed(folder.path(), &["info", &dam("{}"), "--frames", "20-21"]);
    assert_contains(&text, &["frame 20:", "frame 21:"]);
}

/// `info --json` prints the same as JSON.
#[test]
fn info_as_json() {
    let project = project();
    let info = |args: &[&str]| -> Value {
        let args: Vec<_> = ["info", "--json"].into_iter().chain(args.iter().copied()).collect();
        serde_json::from_str(&succeed(project.path(), &args)).expect("JSON and nothing else")
    };
    let water = info(&["water"]);
    assert_eq!(water["frames"], 3);
    assert_eq!((&water["first"], &water["last"]), (&1.into(), &3.into()));
    let described = water["described"].as_array().unwrap();
    assert_eq!(described.len(), 1);
    let frame = &described[0];
    assert_eq!(frame["frame"], 1);
    assert_eq!(frame["particles"], 481);
    assert_eq!(frame["attributes"], Value::Array(Vec::new()));
    assert!(frame["path"].as_str().unwrap().ends_with("block_1.xyz"));
    let close = |value: &Value, expected: f64| {
        assert!((value.as_f64().unwrap() - expected).abs() < 1e-5, "{value}, not {expected}");
    };
    for (i, (min, max)) in [(0.02, 0.57), (0.0, 0.6), (0.0, 0.35)].into_iter().enumerate() {
        close(&frame["min"][i], min);
        close(&frame["max"][i], max);
    }
    close(&frame["radius"], 0.025);
    close(&info(&["water", "--radius", "0.03"])["described"][0]["radius"], 0.03);
    // The input may be a scene.
    let scene = info(&["scenes/block.toml", "--frames", "all"]);
    assert_eq!(scene["described"].as_array().unwrap().len(), 3);
    close(&scene["described"][2]["radius"], 0.025);
}

/// Text and JSON name the axis that points up, and how that is known.
#[test]
fn info_says_which_axis_is_up() {
    let folder = folder();
    let rows = |flat: bool| -> String {
        let y = |i: usize| if flat { 0 } else { i / 4 % 4 };
        (0..64).map(|i| format!("{},{},{},{i}\n", i % 4, y(i), i / 16)).collect()
    };
    let cases = [
        ("x,y,z,Idp", false, "z", "DualSPHysics", true),
        ("x,y,z,k", true, "z", "flat", true),
        ("x,z,y,k", true, "y", "flat", false),
        ("x,y,z,k", false, "y", "default", false),
    ];
    for (columns, flat, up, from, turned) in cases {
        std::fs::write(folder.path().join("a.csv"), format!("{columns}\n{}", rows(flat))).unwrap();
        let text = succeed(folder.path(), &["info", "a.csv"]);
        assert_eq!(text.contains("points up"), from != "default", "{text}");
        assert!(
            from == "default" || text.contains(&format!("{up} points up in the files ({from})")),
            "{text}"
        );
        let json = succeed(folder.path(), &["info", "--json", "a.csv"]);
        let json: Value = serde_json::from_str(&json).unwrap();
        let found = (&json["up"], &json["up_from"], &json["turned"]);
        assert_eq!(found, (&up.into(), &from.into(), &turned.into()), "{columns}");
    }
}

/// Every array of a file is listed as used or ignored, and `--map` reads an attribute from any array.
#[test]
fn info_lists_arrays() {
    let folder = folder();
    let csv = "x,y,z,U_x,U_y,U_z,h\n0,0,0,1,2,3,0.1\n0,0,1,1,2,3,0.1\n";
    std::fs::write(folder.path().join("a.csv"), csv).unwrap();
    let text = succeed(folder.path(), &["info", "a.csv"]);
    assert_contains(&text, &["positions only", "  ignored: U_x (2), U_y (2), U_z (2), h (2)"]);
    let mapped = ["info", "a.csv", "--map", "velocity=U,radius=h"];
    let text = succeed(folder.path(), &mapped);
    assert_contains(&text, &["  used: U_x U_y U_z (2, 3) as velocity, h (2) as radius"]);
    assert_contains(&text, &["radius 0.1 m"]);
    let json = succeed(folder.path(), &[&mapped[..], &["--json"]].concat());
    let json: Value = serde_json::from_str(&json).unwrap();
    let arrays = &json["described"][0]["arrays"];
    assert_eq!(arrays[1], serde_json::json!({ "name": "h", "shape": [2], "used_as": "radius" }));
    let line = super::fail(folder.path(), 3, &["info", "a.csv", "--map", "radius=r"]);
    assert_contains(&line, &["a.csv: radius=r: no array `r`", "h (2)"]);

    // A scene maps arrays by a table.
    let scene = "[particles]\nsource = \"a.csv\"\nmap = { radius = \"h\" }\n";
    std::fs::write(folder.path().join("a.toml"), scene).unwrap();
    assert_contains(&succeed(folder.path(), &["info", "a.toml"]), &["h (2) as radius"]);
}

/// `info` lists arrays that can be selected by, and particles that the program leaves out by itself.
#[test]
fn info_shows_what_can_be_selected() {
    let folder = folder();
    let rows: String =
        (0..40).map(|i| format!("{i},{},0.1,0,{i}\n", [0, 3, 3, 3][i % 4])).collect();
    let text = format!("Idp,Type,x,y,z\n{rows}");
    std::fs::write(folder.path().join("walls.csv"), text).unwrap();
    let info = |args: &[&str]| succeed(folder.path(), &[&["info", "walls.csv"], args].concat());
    let parts = [
        "  30 particles",
        "  Type (40): 0, 3",
        "  10 particles of walls and bodies are left out (Type 0); --select all keeps them",
    ];
    assert_contains(&info(&[]), &parts);
    assert_contains(&info(&["--select", "all"]), &["  40 particles"]);
    assert_contains(&info(&["--select", "type==0"]), &["  10 particles"]);
    let line = super::fail(folder.path(), 3, &["info", "walls.csv", "--select", "mk==1"]);
    assert_contains(&line, &["walls.csv: select mk==1: no array `mk`", "Type (40)"]);
    let line = super::fail(folder.path(), 2, &["info", "walls.csv", "--select", "type"]);
    assert_contains(&line, &["--select", "expected ARRAY==NUMBER"]);
    let json: Value = serde_json::from_str(&info(&["--json"])).unwrap();
    let arrays = json["described"][0]["arrays"].as_array().unwrap();
    assert!(arrays.iter().any(|array| array["values"] == serde_json::json!([0, 3])), "{json}");
}

/// A file is described whatever it lacks, and a list of a hundred arrays in lines that a terminal shows.
#[test]
fn info_describes_any_file() {
    let folder = folder();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("one.csv", "x,y,z,vx,vy,vz\n0,0,0,1,0,0\n");
    write("places.csv", "x,y,z\n1,2,3\n1,2,3\n");
    for name in ["one.csv", "places.csv"] {
        let text = succeed(folder.path(), &["info", name]);
        assert_contains(&text, &["particles", "no radii, and no spacing to estimate one from"]);
    }
    let names: Vec<String> = (0..100).map(|i| format!("attribute_{i}")).collect();
    let numbers = ",0.5".repeat(100);
    write("many.csv", &format!("x,y,z,{}\n0,0,0{numbers}\n1,0,0{numbers}\n", names.join(",")));
    let text = succeed(folder.path(), &["info", "many.csv"]);
    assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    let listed: String = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert_contains(&listed, &["ignored: attribute_0 (2), attribute_1 (2)", "attribute_99 (2)"]);
}

/// A stray particle is counted separately: both the bounds of all particles and those of the bulk, which
/// a camera shows, are reported.
#[test]
fn info_reports_stray_particles() {
    let folder = folder();
    let mut text: String = (0..100).map(|i| format!("{} {} 0\n", i % 10, i / 10)).collect();
    std::fs::write(folder.path().join("whole.xyz"), &text).unwrap();
    let whole = succeed(folder.path(), &["info", "whole.xyz"]);
    assert!(!whole.contains("outside"), "{whole}");
    text += "0 -5000 0\n";
    std::fs::write(folder.path().join("stray.xyz"), &text).unwrap();
    let stray = succeed(folder.path(), &["info", "stray.xyz"]);
    assert_contains(&stray, &["y -5000 to 9", "1 lie outside of x 0 to 9, y 0 to 9"]);
    let json = succeed(folder.path(), &["info", "--json", "stray.xyz"]);
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["described"][0]["outside"], 1);
    assert_eq!(json["described"][0]["bulk_min"][1], 0.0);
}
