//! Colours by data: one command for a picture with a legend, what it tells, and what it refuses.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::{SIZE, adapter, assert_contains, fail, folder, open, render, run, succeed};

/// Writes a flat body of four layers, whose particles have these temperatures, and a colour.
fn write_body(path: &Path, temperature: impl Fn(f32) -> f32) {
    let mut text = "x,y,z,Temperature [K],red,green,blue\n".to_owned();
    for i in 0..30 * 4 * 30 {
        let [x, y, z] = [i % 30, i / 30 % 4, i / 120].map(|i| i as f32 * 0.05);
        writeln!(text, "{x},{y},{z},{},200,30,10", temperature(x)).unwrap();
    }
    fs::write(path, text).unwrap();
}

/// A body in white light from everywhere, seen from above: it shows its own colour.
const WHITE: &str = r#"
[liquid]
color_by = "temperature"
color_range = [20.0, 80.0]
[camera]
eye = [0.725, 4.0, 0.725]
target = [0.725, 0.0, 0.725]
up = [0.0, 0.0, -1.0]
fov_y = 30.0
[environment]
radiance = [1.0, 1.0, 1.0]
"#;

/// The legend's colours are the picture's to 1/255, whatever the map: a flat body of one value in white light has the
/// colour that stands beside its value.
#[test]
fn legends_have_the_colors_of_the_picture() {
    if !adapter() {
        return;
    }
    let folder = folder();
    fs::write(folder.path().join("white.toml"), WHITE).unwrap();
    for (map, share) in [("viridis", 0.2), ("turbo", 0.5), ("coolwarm", 0.8), ("magma", 0.35)] {
        write_body(&folder.path().join("flat.csv"), |_| 20.0 + 60.0 * share);
        let draw = |output: &str, more: &[&str]| {
            let common =
                ["render", "--quiet", "flat.csv", "--scene", "white.toml", "--colormap", map];
            let size = ["--size=640x480", "-o", output];
            succeed(folder.path(), &[&common[..], &size, more].concat());
            open(&folder.path().join(output))
        };
        let (plain, picture) = (draw("plain.png", &[]), draw("legend.png", &["--legend"]));
        let body = plain.get_pixel(320, 240).0;
        let changed = |x: u32, y: u32| plain.get_pixel(x, y) != picture.get_pixel(x, y);
        assert!((0..480).all(|y| !(0..480).any(|x| changed(x, y))), "{map}");
        // Rows of the bar differ little, and the colour is that of one or between two.
        let holds = |(x, y): (u32, u32)| {
            let (a, b) = (picture.get_pixel(x, y).0, picture.get_pixel(x, y + 1).0);
            (0..3).all(|k| {
                let (low, high) = (a[k].min(b[k]), a[k].max(b[k]));
                high - low < 12
                    && (low.saturating_sub(1)..=high.saturating_add(1)).contains(&body[k])
            })
        };
        let mut legend = (480..640).flat_map(|x| (0..479).map(move |y| (x, y)));
        let found = legend.any(|(x, y)| changed(x, y) && holds((x, y)));
        assert!(found, "{map}: {body:?} is not in the legend");
    }
}

/// One command colours by any attribute; it tells the range once, which is the same for every frame.
#[test]
fn one_command_colors_a_sequence() {
    if !adapter() {
        return;
    }
    let folder = folder();
    for name in ["hot", "out"] {
        fs::create_dir(folder.path().join(name)).unwrap();
    }
    for frame in 1..=3u8 {
        let path = folder.path().join(format!("hot/h_{frame}.csv"));
        write_body(&path, |x| 20.0 + 10.0 * x * f32::from(frame));
    }
    let told = run(
        folder.path(),
        &["render", "hot/", SIZE, "--color-by", "TEMPERATURE", "--legend", "-o", "out/p_{}.png"],
    );
    assert_eq!((told.code, told.stdout.as_str()), (0, ""), "{}", told.stderr);
    let lines = told.stderr.lines().filter(|line| line.contains("colors show")).count();
    assert_eq!(lines, 1, "{}", told.stderr);
    assert_contains(&told.stderr, &["Temperature from 20", " K in every frame", "2nd to 98th"]);
    // At this size there is no room for the legend.
    assert_contains(&told.stderr, &["no legend is drawn: pictures of 64 x 48 are too small"]);
    let given = ["--range=0:100", "--colormap=coolwarm", "-o", "given.png"];
    render(folder.path(), &[&["hot/h_1.csv", "--color-by", "temperature"][..], &given].concat());
    for by in ["color", "x", "Temperature"] {
        render(folder.path(), &["hot/h_1.csv", "--color-by", by, "-o", "by.png"]);
    }
    let red = {
        render(folder.path(), &["hot/h_1.csv", "--color-by", "color", "-o", "red.png"]);
        open(&folder.path().join("red.png")).get_pixel(32, 24).0
    };
    assert!(red[0] > 2 * red[1].max(red[2]), "{red:?}");
    render(folder.path(), &["hot/h_1.csv", "--look", "paint", "-o", "paint.png"]);
    let set = ["--set", "liquid.color_by=temperature", "--set", "liquid.color_range=[20, 30]"];
    render(folder.path(), &[&["hot/h_1.csv", "-o", "set.png"][..], &set].concat());
}

/// Options that contradict each other, and attributes that are not there, are refused in one line with what there is.
#[test]
fn contradictions_are_refused() {
    let folder = folder();
    write_body(&folder.path().join("h.csv"), |x| x);
    let by = |attribute: &'static str| ["--color-by", attribute];
    let cases: [(&[&str], &[&str]); 10] = [
        (&by("pressure"), &["no `pressure`", "Temperature, red, green, blue, x, y, z"]),
        (&by("velocity"), &["no `velocity`", "Temperature"]),
        (&["--colormap", "turbo"], &["show an attribute"]),
        (&["--range", "1:2"], &["show an attribute"]),
        (&["--legend"], &["--legend", "--color-by"]),
        (&["--color-by", "color", "--legend"], &["--legend", "color has no scale"]),
        (&["--color-by", "color", "--range", "0:1"], &["color has colors of its own"]),
        (&["--color-by", "temperature", "--range", "3:2"], &["LOW:HIGH", "20:80"]),
        (&["--color-by", "temperature", "--colormap", "jet"], &["viridis, plasma"]),
        (&["--color-by", "temperature", "--tint", "0.5,0.5,0.5"], &["give one of them"]),
    ];
    for (options, told) in cases {
        let line =
            fail(folder.path(), 2, &[&["render", "h.csv", SIZE, "-o", "a.png"], options].concat());
        assert_contains(&line, told);
    }
}

/// `info` lists what particles can be coloured by, with ranges.
#[test]
fn info_tells_ranges() {
    let folder = folder();
    write_body(&folder.path().join("h.csv"), |x| 20.0 + 10.0 * x);
    let text = succeed(folder.path(), &["info", "h.csv"]);
    assert_contains(&text, &["Temperature: 20 to 34.5 K"]);
    let json = succeed(folder.path(), &["info", "h.csv", "--json"]);
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    let ranges = json["described"][0]["ranges"].as_array().unwrap();
    let heat = ranges.iter().find(|range| range["name"] == "Temperature").unwrap();
    assert_eq!((heat["unit"].as_str(), heat["min"].as_f64()), (Some("K"), Some(20.0)));
    assert_eq!(heat["max"].as_f64(), Some(34.5));
}
