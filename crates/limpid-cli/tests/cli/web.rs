//! `limpid web`: what a site has, what it replaces, and that nothing half done is left.

use std::fs;
use std::path::Path;

use tempfile::TempDir;

use super::{assert_contains, assert_names, fail, names, project, succeed};

/// Files of a page, as scripts/web.sh makes it.
const PAGE: [&str; 6] =
    ["index.html", "limpid.js", "limpid_web.js", "limpid_web_bg.wasm", "still.jpg", "worker.js"];

/// The folder of [`project`], with a page that cannot run.
fn with_page() -> TempDir {
    let folder = project();
    let page = folder.path().join("page");
    fs::create_dir(&page).unwrap();
    for name in PAGE.into_iter().chain(["live.html"]) {
        fs::write(page.join(name), name).unwrap();
    }
    let index = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../limpid-web/page/index.html"));
    fs::write(page.join("index.html"), index).unwrap();
    folder
}

/// Writes the site `site` with these arguments; nothing is printed.
#[track_caller]
fn write(folder: &Path, args: &[&str]) {
    let args = [&["web", "-q", "--page=page", "-o", "site"][..], args].concat();
    assert_eq!(succeed(folder, &args), "", "{args:?}");
}

/// As [`write`], for a command that must be refused; returns its line.
#[track_caller]
fn refuse(folder: &Path, code: i32, args: &[&str]) -> String {
    fail(folder, code, &[&["web", "-q", "--page=page"][..], args].concat())
}

fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap()
}

fn scene(folder: &Path) -> toml::Table {
    text(&folder.join("site/scene.toml")).parse().expect("TOML")
}

/// A site has the page, the frames byte by byte with a list of them, and their scene, which its index opens. The camera is
/// left to the page's window, unless it is given.
#[test]
fn a_site_has_page_frames_list_and_scene() {
    let folder = with_page();
    let folder = folder.path();
    let at = |name: &str| folder.join("site").join(name);
    write(folder, &["water", "--scale=0.5", "--fps=24"]);
    let all = [&PAGE[..], &["frames", "scene.toml", "site.txt"]].concat();
    assert_names(&folder.join("site"), &all);
    let frames = ["frame_0001.xyz", "frame_0002.xyz", "frame_0003.xyz"];
    assert_names(&at("frames"), &[&frames[..], &["files.txt"]].concat());
    assert_eq!(text(&at("frames/files.txt")).lines().collect::<Vec<_>>(), frames);
    assert_eq!(text(&at("frames/frame_0002.xyz")), text(&folder.join("water/block_2.xyz")));
    assert_contains(&text(&at("index.html")), &["address src=\"scene.toml\" play>"]);
    let table = scene(folder);
    let particles = &table["particles"];
    assert_eq!(particles["source"].as_str(), Some("frames/frame_{}.xyz"));
    assert_eq!(particles["scale"].as_float(), Some(0.5));
    assert_eq!(particles["fps"].as_float(), Some(24.0));
    assert!(table.contains_key("environment") && !table.contains_key("camera"), "{table}");
    assert_contains(&succeed(folder, &["info", "site/scene.toml"]), &["3 frames"]);

    // A scene of the user's own, with its camera, and one frame.
    write(folder, &["scenes/block.toml", "--frames=3"]);
    assert_names(&at("frames"), &["frame_0003.xyz", "files.txt"]);
    let table = scene(folder);
    assert_eq!(table["camera"]["fov_y"].as_float(), Some(35.0));
    assert!(!table["particles"].as_table().unwrap().contains_key("frame"), "{table}");
    assert_contains(&text(&at("index.html")), &["address src=\"scene.toml\">"]);
    write(folder, &["water", "--camera", "eye=1,2,3 target=0,0,0 fov_y=50"]);
    assert_eq!(scene(folder)["camera"]["fov_y"].as_float(), Some(50.0));
}

/// Foam beside the frames, or named by the scene, comes with them.
#[test]
fn whitewater_comes_with_its_frames() {
    let folder = with_page();
    let folder = folder.path();
    let foam = |frame: i32| folder.join(format!("water/block_foam_{frame}.xyz"));
    for frame in 1..=3 {
        fs::copy(folder.join("water/block_2.xyz"), foam(frame)).unwrap();
    }
    let source = || scene(folder)["diffuse"][0]["source"].as_str().map(str::to_owned);
    write(folder, &["water", "--frames=2-3"]);
    let files = ["frame_0002.xyz", "frame_0003.xyz", "files.txt"];
    assert_names(&folder.join("site/whitewater-1"), &files);
    assert_eq!(source().as_deref(), Some("whitewater-1/frame_{}.xyz"));
    // One file for all frames, by a scene.
    fs::copy(foam(1), folder.join("scenes/still.xyz")).unwrap();
    let still = "[[diffuse]]\nsource = \"still.xyz\"\nkinds = [\"spray\"]\n";
    fs::write(folder.join("scenes/still.toml"), still).unwrap();
    write(folder, &["water", "--scene=scenes/still.toml"]);
    assert_eq!(source().as_deref(), Some("whitewater-1.xyz"));
    assert!(folder.join("site/whitewater-1.xyz").is_file());
    // It belongs to the scene's frame, which comes along or does not.
    let particles = "[particles]\nsource = \"../water/block_{}.xyz\"\nframe = 2\n";
    fs::write(folder.join("scenes/frame.toml"), format!("{particles}{still}")).unwrap();
    write(folder, &["scenes/frame.toml", "--frames=2-3"]);
    assert_eq!(source().as_deref(), Some("whitewater-1.xyz"));
    assert_eq!(scene(folder)["particles"]["frame"].as_integer(), Some(2));
    write(folder, &["scenes/frame.toml", "--frames=1"]);
    assert!(scene(folder).get("diffuse").is_none());
    // A list of files, numbered from 0.
    let file = |frame: i32| {
        format!("{{\"name\": \"../water/block_foam_{frame}.xyz\", \"time\": {frame}}}")
    };
    let list =
        format!("{{\"file-series-version\": \"1.0\", \"files\": [{}, {}]}}", file(1), file(2));
    fs::write(folder.join("scenes/foam.xyz.series"), list).unwrap();
    let listed = "[[diffuse]]\nsource = \"foam.xyz.series\"\n";
    fs::write(folder.join("scenes/listed.toml"), listed).unwrap();
    write(folder, &["water", "--scene=scenes/listed.toml"]);
    assert_names(&folder.join("site/whitewater-1"), &["frame_0001.xyz", "files.txt"]);
    assert_contains(&succeed(folder, &["info", "site/scene.toml"]), &["3 frames"]);
    // A single file beside the frames has the frame of its number, and its name tells the kind of particles without one.
    fs::remove_file(foam(1)).unwrap();
    fs::remove_file(foam(2)).unwrap();
    fs::rename(foam(3), folder.join("water/block_spray_3.xyz")).unwrap();
    write(folder, &["water"]);
    assert_eq!(source().as_deref(), Some("whitewater-1/frame_{}.xyz"));
    assert_names(&folder.join("site/whitewater-1"), &["frame_0003.xyz", "files.txt"]);
    let kinds = scene(folder)["diffuse"][0]["kinds"].clone();
    let expected = ["spray", "foam", "bubbles", "dust"].map(toml::Value::from).to_vec();
    assert_eq!(kinds, toml::Value::Array(expected));
    // Frames that have none.
    write(folder, &["water", "--frames=1"]);
    assert!(scene(folder).get("diffuse").is_none());
}

/// Meshes and textures of a scene come with it.
#[test]
fn solids_come_with_their_files() {
    let folder = with_page();
    let folder = folder.path();
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    fs::write(folder.join("scenes/rock.obj"), mesh).unwrap();
    let solid = "[[solid]]\nshape = \"mesh\"\nfile = \"rock.obj\"\ncolor = [0.5, 0.5, 0.5]\n";
    let own = text(&folder.join("scenes/block.toml"));
    fs::write(folder.join("scenes/rocks.toml"), format!("{own}{solid}{solid}")).unwrap();
    write(folder, &["scenes/rocks.toml"]);
    let table = scene(folder);
    let solids = table["solid"].as_array().unwrap();
    let files: Vec<_> = solids.iter().filter_map(|solid| solid.get("file")?.as_str()).collect();
    assert_eq!(files, ["solids/1.obj"; 2]);
    assert_eq!(text(&folder.join("site/solids/1.obj")), mesh);
    assert_contains(&succeed(folder, &["info", "site/scene.toml"]), &["3 frames"]);
}

/// A site replaces an older one, and no folder with files of others. After an error the older one is as it was.
#[test]
fn only_sites_are_replaced() {
    let folder = with_page();
    let folder = folder.path();
    let site = folder.join("site");
    fs::create_dir(&site).unwrap();
    write(folder, &["water"]);
    write(folder, &["water", "--frames=1-2"]);
    assert_eq!(names(&site.join("frames")).len(), 3);
    let entries = names(folder);

    // Files of the site are not copied into the one that replaces it.
    let line = refuse(folder, 2, &["site/frames", "-o", "site"]);
    assert_contains(&line, &["which would be replaced", "choose another -o"]);
    fs::remove_file(folder.join("water/block_2.xyz")).unwrap();
    fs::create_dir(folder.join("water/block_2.xyz")).unwrap();
    refuse(folder, 4, &["water", "-o", "site"]);
    fail(folder, 4, &["web", "-q", "water/block_1.xyz", "--page=nowhere", "-o", "site"]);
    let line = refuse(folder, 2, &["water/block_1.xyz", "-o", "water"]);
    assert_contains(&line, &["did not write block_1.xyz", "choose another -o"]);
    for name in ["CNAME", "frames/mine.txt"] {
        fs::write(site.join(name), "mine").unwrap();
        let line = refuse(folder, 2, &["water/block_1.xyz", "-o", "site"]);
        assert_contains(&line, &[&format!("did not write {name}")]);
        fs::remove_file(site.join(name)).unwrap();
    }
    assert_eq!(names(folder), entries, "nothing is left");
    assert_eq!(names(&site.join("frames")).len(), 3);
    // No half of a new one is left either.
    refuse(folder, 4, &["water", "-o", "new/site"]);
    assert!(!folder.join("new/site").exists());
    fs::write(folder.join("file"), "").unwrap();
    refuse(folder, 4, &["water/block_1.xyz", "-o", "file"]);
}

/// Inputs that cannot be served as they are are refused, with what helps.
#[test]
fn frames_are_single_files() {
    let folder = with_page();
    let folder = folder.path();
    for rank in 0..2 {
        fs::copy(folder.join("water/block_1.xyz"), folder.join(format!("rank{rank}_1.xyz")))
            .unwrap();
    }
    let line = refuse(folder, 2, &["--merge", "rank{r}_{}.xyz", "-o", "site"]);
    assert_contains(&line, &["one file", "limpid convert"]);
    assert_contains(&refuse(folder, 2, &["-o", "site"]), &["expected an INPUT", "limpid web"]);
    assert_contains(&refuse(folder, 2, &["-", "-o", "site"]), &["save standard input"]);
    assert_contains(&refuse(folder, 2, &["water"]), &["--output"]);
    assert!(!folder.join("site").exists());
}
