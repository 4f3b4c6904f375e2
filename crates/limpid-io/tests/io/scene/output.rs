//! Output files: their names, and atomic writing.

use std::fs;
use std::io::{self, Write as _};
use std::path::Path;

use image::{DynamicImage, Rgb, RgbImage};
use limpid_io::Error;
use limpid_io::output::{FileKind, OutputNames, write_atomically, write_png};
use tempfile::TempDir;

use super::assert_contains;

/// Names of pictures, in every notation for frame numbers.
#[test]
fn output_names() {
    let folder = tempfile::tempdir().unwrap();
    let existing = folder.path().to_str().unwrap();
    let numbered = [
        ("a.png", 1, 7, "a.png"),
        ("a_{}.png", 1, 7, "a_7.png"),
        ("a_{}.png", 3, 12345, "a_12345.png"),
        ("a_####.png", 3, 7, "a_0007.png"),
        ("a_#.png", 3, 12, "a_12.png"),
        ("a_##.png", 3, 123, "a_123.png"),
        ("a_%d.png", 3, 7, "a_7.png"),
        ("a_%04d.png", 3, 7, "a_0007.png"),
        ("a_%4d.png", 3, 7, "a_0007.png"),
        ("a_$F.png", 3, 7, "a_7.png"),
        ("a.$F4.png", 3, 7, "a.0007.png"),
        ("####", 3, 7, "0007"),
        ("a_####.png", 3, -7, "a_-0007.png"),
        ("out/", 1, 7, "out/frame_0007.png"),
        ("out/", 3, 70000, "out/frame_70000.png"),
        // The placeholder must be in the file's name, not the folder's.
        ("take#2/a_####.png", 3, 7, "take#2/a_0007.png"),
        ("take{}/a.png", 1, 7, "take{}/a.png"),
        // A per cent sign alone is not a placeholder.
        ("100%.png", 1, 7, "100%.png"),
        ("50%_%04d.png", 3, 7, "50%_0007.png"),
        ("50%_####.png", 3, 7, "50%_0007.png"),
    ];
    for (output, frames, frame, expected) in numbered {
        let names = OutputNames::parse(output, frames).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(names.path(frame), Path::new(expected), "{output}");
    }
    let inside = OutputNames::parse(existing, 3).unwrap().path(7);
    assert_eq!(inside, folder.path().join("frame_0007.png"));

    for output in ["a.png", "take{}/a.png", "100%.png"] {
        let error = OutputNames::parse(output, 3).unwrap_err();
        assert!(matches!(error, Error::Usage(_)), "{error:?}");
        assert_contains(&error.to_string(), &["3 frames", output, "####"]);
    }
}

fn names(folder: &TempDir) -> Vec<String> {
    let entries = fs::read_dir(folder.path()).unwrap();
    let mut names: Vec<_> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Files are written atomically: a failed write leaves an existing file unchanged, and no temporary
/// file.
#[test]
fn files_are_written_atomically() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    let full = |file: &mut io::BufWriter<&fs::File>| {
        file.write_all(&[b'x'; 100_000])?;
        Err(io::Error::new(io::ErrorKind::StorageFull, "the disk is full"))
    };
    let error = write_atomically(&path, FileKind::CACHE, full).unwrap_err();
    assert!(matches!(error, Error::Io { action: "write", .. }), "{error:?}");
    assert_contains(&error.to_string(), &["a.txt", "the disk is full"]);
    assert_eq!(names(&folder), [""; 0]);

    write_atomically(&path, FileKind::CACHE, |file| file.write_all(b"first")).unwrap();
    write_atomically(&path, FileKind::CACHE, full).unwrap_err();
    assert_eq!(fs::read(&path).unwrap(), b"first");
    write_atomically(&path, FileKind::CACHE, |file| file.write_all(b"second")).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"second");
    assert_eq!(names(&folder), ["a.txt"]);

    // A link is kept, and its target is replaced.
    #[cfg(unix)]
    {
        let link = folder.path().join("latest");
        std::os::unix::fs::symlink("a.txt", &link).unwrap();
        write_atomically(&link, FileKind::CACHE, |file| file.write_all(b"third")).unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read(&path).unwrap(), b"third");
        fs::remove_file(&link).unwrap();
    }

    // A path that is a folder, one whose folder is a file, and one whose folder is missing.
    fs::create_dir(folder.path().join("taken")).unwrap();
    for name in ["taken", "a.txt/b.txt", "none/b.txt"] {
        let error = write_atomically(&folder.path().join(name), FileKind::CACHE, |file| {
            file.write_all(b"lost")
        });
        let message = error.unwrap_err().to_string();
        assert_contains(&message, &[name, "cannot write"]);
        assert!(!message.contains(".limpid-"), "the message shows the temporary name: {message}");
    }
    assert_eq!(names(&folder), ["a.txt", "taken"]);
}

/// Output files have ordinary permissions, not the private ones of temporary files.
#[cfg(unix)]
#[test]
fn files_have_ordinary_permissions() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let [ours, plain] = ["ours", "plain"].map(|name| folder.path().join(name));
    write_atomically(&ours, FileKind::CACHE, |file| file.write_all(b"x")).unwrap();
    fs::write(&plain, "x").unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&ours), mode(&plain));
}

/// Devices and sockets are never replaced by a file: `-o /dev/null` as root must be harmless.
#[cfg(unix)]
#[test]
fn devices_and_sockets_are_not_replaced() {
    use std::os::unix::fs::FileTypeExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("socket");
    let _socket = std::os::unix::net::UnixListener::bind(&path).unwrap();
    write_atomically(&path, FileKind::CACHE, |file| file.write_all(b"x")).unwrap_err();
    assert!(fs::metadata(&path).unwrap().file_type().is_socket());
    assert_eq!(names(&folder), ["socket"]);
}

/// A PNG preserves its pixels, at any size.
#[test]
fn pngs_preserve_pixels() {
    let folder = tempfile::tempdir().unwrap();
    for (width, height) in [(1, 1), (3, 7), (640, 1)] {
        let picture = RgbImage::from_fn(width, height, |x, y| Rgb([x as u8, y as u8, 200]));
        let path = folder.path().join("a.png");
        write_png(&path, &picture).unwrap();
        assert_eq!(image::open(&path).unwrap(), DynamicImage::ImageRgb8(picture));
    }
}
