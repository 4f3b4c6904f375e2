//! Films: written files are decoded and compared with their pictures, directly and through the command
//! line.

mod command;
mod formats;

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;

use glam::UVec2;
use image::{AnimationDecoder as _, RgbImage};
use limpid::gpu::Gpu;
use tempfile::TempDir;

const SIZE: UVec2 = UVec2::new(160, 120);

fn folder() -> TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// Names of all entries of a folder, including hidden temporary files.
fn names(folder: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(folder).expect("the folder can be listed");
    entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
}

fn is_set(name: &str) -> bool {
    std::env::var(name).is_ok_and(|value| !value.is_empty() && value != "0")
}

/// Whether ffmpeg and ffprobe exist; with `LIMPID_REQUIRE_FFMPEG` a missing one fails the test.
fn ffmpeg() -> bool {
    static FOUND: OnceLock<bool> = OnceLock::new();
    let found = FOUND.get_or_init(|| {
        let runs = |name| Command::new(name).arg("-version").output().is_ok();
        runs("ffmpeg") && runs("ffprobe")
    });
    assert!(*found || !is_set("LIMPID_REQUIRE_FFMPEG"), "this test must not be skipped here");
    if !found {
        eprintln!("skipped: no ffmpeg and ffprobe on PATH");
    }
    *found
}

/// Whether there is an adapter; with `LIMPID_REQUIRE_GPU` or `CI` a missing one fails the test.
fn adapter() -> bool {
    static FOUND: OnceLock<Result<(), String>> = OnceLock::new();
    let found = FOUND.get_or_init(|| Gpu::headless().map(|_| ()).map_err(|e| e.to_string()));
    let Err(problem) = found else { return true };
    let required = is_set("CI") || is_set("LIMPID_REQUIRE_GPU");
    assert!(!required, "this test must not be skipped here: {problem}");
    eprintln!("skipped: {problem}");
    false
}

/// Number of processes with this folder on their command line; 0 without `/proc`.
fn processes(folder: &Path) -> usize {
    let folder = folder.to_str().unwrap();
    let Ok(entries) = fs::read_dir("/proc") else { return 0 };
    let lines = entries.filter_map(|entry| fs::read(entry.ok()?.path().join("cmdline")).ok());
    lines.filter(|line| String::from_utf8_lossy(line).contains(folder)).count()
}

/// Reads the pictures of a GIF, their delays, 1/100 s, and its repetition.
fn read_gif(path: &Path) -> (Vec<RgbImage>, Vec<u16>, gif::Repeat) {
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let mut decoder = options.read_info(fs::File::open(path).unwrap()).unwrap();
    let size = UVec2::new(decoder.width().into(), decoder.height().into());
    let (mut pictures, mut delays) = (Vec::new(), Vec::new());
    while let Some(frame) = decoder.read_next_frame().unwrap() {
        assert_eq!((frame.left, frame.top), (0, 0));
        let rgb = frame.buffer.chunks_exact(4).flat_map(|pixel| pixel[..3].iter().copied());
        pictures.push(RgbImage::from_raw(size.x, size.y, rgb.collect()).expect("whole frames"));
        delays.push(frame.delay);
    }
    let repeat = decoder.repeat();
    (pictures, delays, repeat)
}

fn read_apng(path: &Path) -> Vec<RgbImage> {
    let file = std::io::BufReader::new(fs::File::open(path).unwrap());
    let decoder = image::codecs::png::PngDecoder::new(file).unwrap();
    assert!(decoder.is_apng().unwrap());
    let frames = decoder.apng().unwrap().into_frames().collect_frames().unwrap();
    let rgb = |frame: image::Frame| image::DynamicImage::from(frame.into_buffer()).into_rgb8();
    frames.into_iter().map(rgb).collect()
}

/// Mean absolute difference per channel, 0 to 255.
fn difference(a: &RgbImage, b: &RgbImage) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let total: f64 = a.iter().zip(b.iter()).map(|(&a, &b)| f64::from(a.abs_diff(b))).sum();
    total / a.len() as f64
}

fn file_url(path: &Path) -> String {
    format!("file:{}", path.display())
}

/// Decodes the pictures of a video with the colour matrix `matrix`.
fn decode(path: &Path, matrix: &str) -> Vec<RgbImage> {
    let filter = format!("scale=in_color_matrix={matrix}:flags=accurate_rnd+full_chroma_int");
    let output = Command::new("ffmpeg")
        .args(["-v", "error", "-nostdin", "-i", &file_url(path), "-vf", &filter])
        .args(["-f", "rawvideo", "-pix_fmt", "rgb24", "pipe:1"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let frames = output.stdout.chunks_exact((3 * SIZE.x * SIZE.y) as usize);
    frames.map(|rgb| RgbImage::from_raw(SIZE.x, SIZE.y, rgb.to_vec()).unwrap()).collect()
}
