//! Output files: their names, and that each is there as a whole or not at all.

use std::fs;
use std::io::{self, Write as _};
use std::path::Path;

use image::{DynamicImage, Rgb, RgbImage};
use limpid_io::Error;
use limpid_io::output::{FileKind, OutputNames, write_atomically, write_png};
use tempfile::TempDir;

use super::assert_tells;

/// Names of pictures, in every dialect in which frames are written.
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
        // Only the file's name is numbered, not the folder's.
        ("take#2/a_####.png", 3, 7, "take#2/a_0007.png"),
        ("take{}/a.png", 1, 7, "take{}/a.png"),
        // A per cent sign alone is none.
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
        assert_tells(&error.to_string(), &["3 frames", output, "####"]);
    }
}

fn names(folder: &TempDir) -> Vec<String> {
    let entries = fs::read_dir(folder.path()).unwrap();
    let mut names: Vec<_> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// A file is there as a whole or not at all: a failed write keeps what was there before, and
/// leaves no temporary file.
#[test]
fn files_are_written_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.txt");
    let full = |file: &mut io::BufWriter<&fs::File>| {
        file.write_all(&[b'x'; 100_000])?;
        Err(io::Error::new(io::ErrorKind::StorageFull, "the disk is full"))
    };
    let error = write_atomically(&path, FileKind::Cache, full).unwrap_err();
    assert!(matches!(error, Error::Io { action: "write", .. }), "{error:?}");
    assert_tells(&error.to_string(), &["a.txt", "the disk is full"]);
    assert_eq!(names(&folder), [""; 0]);

    write_atomically(&path, FileKind::Cache, |file| file.write_all(b"first")).unwrap();
    write_atomically(&path, FileKind::Cache, full).unwrap_err();
    assert_eq!(fs::read(&path).unwrap(), b"first");
    write_atomically(&path, FileKind::Cache, |file| file.write_all(b"second")).unwrap();
    assert_eq!(fs::read(&path).unwrap(), b"second");
    assert_eq!(names(&folder), ["a.txt"]);

    // A link stays one, to the file that is written.
    #[cfg(unix)]
    {
        let link = folder.path().join("latest");
        std::os::unix::fs::symlink("a.txt", &link).unwrap();
        write_atomically(&link, FileKind::Cache, |file| file.write_all(b"third")).unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read(&path).unwrap(), b"third");
        fs::remove_file(&link).unwrap();
    }

    // A name that is taken by a folder, and a folder that is a file or not there.
    fs::create_dir(folder.path().join("taken")).unwrap();
    for name in ["taken", "a.txt/b.txt", "none/b.txt"] {
        let error = write_atomically(&folder.path().join(name), FileKind::Cache, |file| {
            file.write_all(b"lost")
        });
        let message = error.unwrap_err().to_string();
        assert_tells(&message, &[name, "cannot write"]);
        assert!(!message.contains(".limpid-"), "the temporary name is nobody's concern: {message}");
    }
    assert_eq!(names(&folder), ["a.txt", "taken"]);
}

/// Temporary files are private; what they become is as readable as any other file.
#[cfg(unix)]
#[test]
fn files_have_ordinary_permissions() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let [ours, plain] = ["ours", "plain"].map(|name| folder.path().join(name));
    write_atomically(&ours, FileKind::Cache, |file| file.write_all(b"x")).unwrap();
    fs::write(&plain, "x").unwrap();
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
    assert_eq!(mode(&ours), mode(&plain));
}

/// Devices and sockets are never replaced by a file: `-o /dev/null` as root must stay harmless.
#[cfg(unix)]
#[test]
fn what_is_no_file_is_not_replaced() {
    use std::os::unix::fs::FileTypeExt;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("socket");
    let _socket = std::os::unix::net::UnixListener::bind(&path).unwrap();
    write_atomically(&path, FileKind::Cache, |file| file.write_all(b"x")).unwrap_err();
    assert!(fs::metadata(&path).unwrap().file_type().is_socket());
    assert_eq!(names(&folder), ["socket"]);
}

/// A PNG holds the pixels that were given, in any size.
#[test]
fn pngs_keep_their_pixels() {
    let folder = tempfile::tempdir().unwrap();
    for (width, height) in [(1, 1), (3, 7), (640, 1)] {
        let picture = RgbImage::from_fn(width, height, |x, y| Rgb([x as u8, y as u8, 200]));
        let path = folder.path().join("a.png");
        write_png(&path, &picture).unwrap();
        assert_eq!(image::open(&path).unwrap(), DynamicImage::ImageRgb8(picture));
    }
}
