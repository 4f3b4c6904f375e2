//! Targets of paths: empty files, links, folders and pipes.

use std::fs;
use std::os::unix::ffi::OsStringExt as _;
use std::os::unix::fs::symlink;

use super::{Case, Way, case};
use crate::files;
use crate::prepare::{block, forbid, nothing, pipe, write};

pub(super) const CASES: &[Case] = &[
    case(
        "an empty BGEO file",
        "info a.bgeo",
        |f| write(f.join("a.bgeo"), ""),
        Way::Small,
        3,
        "a.bgeo: this is an empty file, not a BGEO file of version 5",
    ),
    case(
        "an empty VTK file",
        "info a.vtk",
        |f| write(f.join("a.vtk"), ""),
        Way::Small,
        3,
        "a.vtk: this is an empty file, not a legacy VTK file",
    ),
    case(
        "an empty archive",
        "info a.npz",
        |f| write(f.join("a.npz"), ""),
        Way::Small,
        3,
        "a.npz: this is an empty file, not …",
    ),
    case(
        "an empty HDF5 file",
        "info a.h5",
        |f| write(f.join("a.h5"), ""),
        Way::Small,
        3,
        "a.h5: this is an empty file, not an HDF5 file",
    ),
    case(
        "HDF5 that ends early",
        "info a.h5",
        |f| write(f.join("a.h5"), &files::PLAIN_HDF5[..2000]),
        Way::Small,
        4,
        "a.h5…",
    ),
    case(
        "a trajectory whose last frame claims more particles than it has",
        "info --radius 1 --frames all a.extxyz",
        |f| write(f.join("a.extxyz"), "1\n\nO 0 0 0\n99999999999999\n\nO 0 0 0\n"),
        Way::Small,
        4,
        "a.extxyz: line 7: particle 1: expected 99999999999999 lines",
    ),
    case(
        "an empty text of positions: no particles",
        "info a.xyz",
        |f| write(f.join("a.xyz"), ""),
        Way::Small,
        0,
        "",
    ),
    case(
        "an empty scene",
        "info a.toml",
        |f| write(f.join("a.toml"), ""),
        Way::Small,
        2,
        "a.toml: has no [particles]…",
    ),
    case(
        "an empty picture",
        "compare a.png a.png",
        |f| write(f.join("a.png"), ""),
        Way::Small,
        3,
        "a.png: not a PNG…",
    ),
    case(
        "a file that is not there",
        "info a.bgeo",
        nothing,
        Way::Small,
        4,
        "a.bgeo: cannot read: No such file or directory (os error 2)",
    ),
    case(
        "a folder by a file's name",
        "info a.bgeo",
        |f| fs::create_dir(f.join("a.bgeo")).unwrap(),
        Way::Small,
        4,
        "a.bgeo: no particle files in this folder; limpid reads .bgeo…",
    ),
    case(
        "a folder among the frames",
        "info a_{}.xyz",
        |f| fs::create_dir(f.join("a_1.xyz")).unwrap(),
        Way::Small,
        4,
        "./a_1.xyz: cannot read: this is a folder, expected a file",
    ),
    case(
        "a pipe that nobody writes to",
        "info a.bgeo",
        |f| pipe(&f.join("a.bgeo")),
        Way::Small,
        4,
        "a.bgeo: cannot read: this is a pipe or device, expected a file",
    ),
    case(
        "a pipe beside a `.pos`",
        "info a.pos",
        |f| {
            write(f.join("a.pos"), [0; 8]);
            pipe(&f.join("a.ani"));
        },
        Way::Small,
        4,
        "a.ani: cannot read: this is a pipe or device, expected a file",
    ),
    case(
        "a pipe as a scene",
        "render --scene a.toml a.xyz",
        |f| {
            write(f.join("a.xyz"), "0 0 0");
            pipe(&f.join("a.toml"));
        },
        Way::Small,
        4,
        "a.toml: cannot read: this is a pipe or device, expected a file",
    ),
    case(
        "a pipe as a camera path",
        "render --camera-path a.toml water.xyz",
        |f| {
            block(f);
            pipe(&f.join("a.toml"));
        },
        Way::Small,
        4,
        "a.toml: cannot read: this is a pipe or device, expected a file",
    ),
    case(
        "a pipe as an environment map",
        "info a.toml",
        |f| {
            write(f.join("a.toml"), "environment.map = \"a.hdr\"");
            pipe(&f.join("a.hdr"));
        },
        Way::Small,
        4,
        "a.hdr: cannot read: this is a pipe or device, expected a file",
    ),
    case(
        "a pipe to compare",
        "compare a.png a.png",
        |f| pipe(&f.join("a.png")),
        Way::Small,
        4,
        "a.png: cannot read: this is a pipe or device, expected a file",
    ),
    case(
        "a link to `/dev/zero`",
        "info a.ply",
        |f| symlink("/dev/zero", f.join("a.ply")).unwrap(),
        Way::Small,
        4,
        "a.ply: cannot read: this is a pipe or device, expected a file",
    ),
    case(
        "a link to a file",
        "info a.xyz",
        |f| {
            block(f);
            symlink("water.xyz", f.join("a.xyz")).unwrap();
        },
        Way::Small,
        0,
        "",
    ),
    case(
        "a link to a folder",
        "info a",
        |f| {
            fs::create_dir(f.join("b")).unwrap();
            block(&f.join("b"));
            symlink("b", f.join("a")).unwrap();
        },
        Way::Small,
        0,
        "",
    ),
    case(
        "a link to nothing",
        "info a.xyz",
        |f| symlink("nothing", f.join("a.xyz")).unwrap(),
        Way::Small,
        4,
        "a.xyz: a link to `nothing`, which is missing",
    ),
    case(
        "a link to itself",
        "info a.xyz",
        |f| symlink("a.xyz", f.join("a.xyz")).unwrap(),
        Way::Small,
        4,
        "a.xyz: cannot read: Too many levels of symbolic links (os error 40)",
    ),
    case(
        "a link to nothing among the frames",
        "info a_{}.xyz",
        |f| symlink("nothing", f.join("a_1.xyz")).unwrap(),
        Way::Small,
        4,
        "./a_1.xyz: cannot read: No such file or directory (os error 2)",
    ),
    case(
        "a file that one may not read",
        "info water.xyz",
        |f| {
            block(f);
            forbid(&f.join("water.xyz"));
        },
        Way::Nobody,
        4,
        "water.xyz: cannot read: Permission denied (os error 13)",
    ),
    case(
        "a folder that one may not list",
        "info a",
        |f| {
            fs::create_dir(f.join("a")).unwrap();
            forbid(&f.join("a"));
        },
        Way::Nobody,
        4,
        "a: cannot list: Permission denied (os error 13)",
    ),
    case(
        "a folder that one may not write to",
        "convert water.xyz a.ply",
        block,
        Way::Nobody,
        4,
        "a.ply: cannot write: permission denied",
    ),
    case(
        "a name of 300 letters",
        "info aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa.xyz",
        nothing,
        Way::Small,
        4,
        "…: cannot read: File name too long (os error 36)",
    ),
    case(
        "a name that is not UTF-8, in a folder: no frame",
        "info .",
        |f| {
            block(f);
            let name = std::ffi::OsString::from_vec(b"a\xff.xyz".to_vec());
            write(f.join(name), "0 0 0");
        },
        Way::Small,
        0,
        "",
    ),
    case(
        "a name that moves the cursor",
        "info a\x1b[2J\n.xyz",
        nothing,
        Way::Small,
        4,
        "a?[2J?.xyz: cannot read: No such file or directory (os error 2)",
    ),
];
