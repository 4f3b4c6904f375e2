//! Rigid bodies of SPlisHSPlasH.

use std::fs;

use limpid::glam::{DQuat, DVec3, Vec4};
use limpid_io::meshes::rigid_bodies::{Pose, RigidBody, read_bodies, read_poses};

use super::{folder, le, path};

/// Two bodies as the exporter describes them.
fn descriptions() -> Vec<u8> {
    let mut bytes = 2_u32.to_le_bytes().to_vec();
    for (name, scale, is_wall, color) in [
        ("UnitBox.obj", [1.0, 2.0, 0.5], 1, [0.1, 0.4, 0.6, 1.0]),
        ("sphère.obj", [-1.0, 1.0, 1.0], 0, [1.0, 1.0, 1.0, 0.5]),
    ] {
        bytes.extend((name.len() as u32).to_le_bytes());
        bytes.extend(name.as_bytes());
        bytes.extend(le(scale));
        bytes.push(is_wall);
        bytes.extend(le(color));
    }
    bytes
}

/// The first as it is, the second turned by a quarter about z: x becomes y. Column by column.
fn poses(height: f32) -> Vec<u8> {
    let first = le([0.5, height, -1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let second = le([0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    [first, second].concat()
}

#[test]
fn frames_are_read() {
    let first = [descriptions(), poses(2.0)].concat();
    let folder = folder(&[("rb_data_1.bin", &first), ("rb_data_2.bin", &poses(3.0))]);
    let bodies = read_bodies(&path(&folder, "rb_data_1.bin")).unwrap();
    let still = Pose { translate: DVec3::new(0.5, 2.0, -1.0), rotate: DQuat::IDENTITY };
    let expected = RigidBody {
        mesh: path(&folder, "UnitBox.obj"),
        scale: DVec3::new(1.0, 2.0, 0.5),
        is_wall: true,
        color: Vec4::new(0.1, 0.4, 0.6, 1.0),
        pose: still,
    };
    assert_eq!(bodies[0], expected);
    assert_eq!((bodies.len(), bodies[1].mesh.clone()), (2, path(&folder, "sphère.obj")));
    assert!(!bodies[1].is_wall);
    assert!((bodies[1].pose.rotate * DVec3::X).distance(DVec3::Y) < 1e-12);
    let second = read_poses(&path(&folder, "rb_data_2.bin"), 2).unwrap();
    assert_eq!(second[0].translate, DVec3::new(0.5, 3.0, -1.0));
    assert_eq!(second[1], bodies[1].pose);
}

#[test]
fn damaged_frames_are_errors_with_their_place() {
    let first = [descriptions(), poses(2.0)].concat();
    let folder = folder(&[]);
    let file = path(&folder, "rb_data_1.bin");
    for length in 0..first.len() {
        fs::write(&file, &first[..length]).unwrap();
        assert!(read_bodies(&file).is_err(), "{length}");
    }
    let check = |bytes: &[u8], fragments: &[&str]| {
        fs::write(&file, bytes).unwrap();
        let error = read_bodies(&file).unwrap_err().to_string();
        for fragment in fragments.iter().chain(&["rb_data_1.bin: byte "]) {
            assert!(error.contains(fragment), "{fragment:?} not in: {error}");
        }
    };
    let with = |at: usize, word: [u8; 4]| {
        let mut bytes = first.clone();
        bytes[at..at + 4].copy_from_slice(&word);
        bytes
    };
    check(&with(0, u32::MAX.to_le_bytes()), &["byte 0", "4294967295 bodies", "the first frame?"]);
    check(&with(0, [3, 0, 0, 0]), &["3 bodies do not fit"]);
    check(&with(0, [1, 0, 0, 0]), &[]);
    check(&with(4, u32::MAX.to_le_bytes()), &["byte 8", "the name of a mesh file"]);
    check(&with(8, [0xff; 4]), &["byte 8", "UTF-8"]);
    check(&with(8, [0; 4]), &["no mesh file"]);
    check(&with(4, [0; 4]), &["no mesh file"]);
    check(&with(19, f32::NAN.to_le_bytes()), &["byte 19", "the scale"]);
    let pose = descriptions().len();
    check(&with(pose, f32::INFINITY.to_le_bytes()), &[&format!("byte {pose}"), "translation"]);
    check(&with(pose, 1e20_f32.to_le_bytes()), &["less than 1e18 m"]);
    check(
        &with(pose + 12, 2.0_f32.to_le_bytes()),
        &[&format!("byte {}", pose + 12), "no rotation"],
    );
    // A mirror is no rotation.
    check(&with(pose + 12, (-1.0_f32).to_le_bytes()), &["no rotation"]);
    check(&[&first[..], &[0]].concat(), &[&format!("byte {}", first.len()), "1 bytes follow"]);
    check(&poses(1.0), &["the first frame?"]);

    fs::write(&file, poses(1.0)).unwrap();
    for count in [0, 1, 3, usize::MAX] {
        let error = read_poses(&file, count).unwrap_err().to_string();
        assert!(error.contains("rb_data_1.bin: byte "), "{error}");
    }
    assert!(read_poses(folder.path(), 1).unwrap_err().to_string().contains("a folder"));
}
