//! The list of hostile inputs and their expected outcomes. `docs/hostile.md` has the rules behind them.

use std::fs;
use std::os::unix::ffi::OsStringExt as _;
use std::os::unix::fs::symlink;
use std::path::Path;

use super::files;
use super::prepare::{
    blank, blank_surroundings, block, block_and, bomb, dam, forbid, found, images, lying_archive,
    many, many_names, nothing, nulls, pipe, shared_pieces, sparse, textured, two_pictures, write,
};

/// A run of the program and its expected outcome.
pub(crate) struct Case {
    /// The case in words.
    pub(crate) what: &'static str,
    /// The arguments; quotes keep blanks.
    pub(crate) arguments: &'static str,
    /// Writes the files.
    pub(crate) prepare: fn(&Path),
    /// The environment of the run.
    pub(crate) way: Way,
    pub(crate) code: i32,
    /// Standard error without `limpid: `; `…` matches any text.
    pub(crate) message: &'static str,
}

/// The environment of a run.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Way {
    /// At most 3 GiB of address space.
    Small,
    /// No limits, since drivers need more address space; needs an adapter.
    Drawing,
    /// An unprivileged user.
    Nobody,
    /// A limit of 4 KiB on the length of files.
    Short,
    /// A disk of 4 KiB.
    Full,
    /// A disk of 4 KiB; needs an adapter.
    FullDrawing,
}

const fn case(
    what: &'static str,
    arguments: &'static str,
    prepare: fn(&Path),
    way: Way,
    code: i32,
    message: &'static str,
) -> Case {
    Case { what, arguments, prepare, way, code, message }
}

pub(crate) const CASES: &[Case] = &[
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
    case(
        "4 GiB of nothing as `.bgeo`",
        "info a.bgeo",
        |f| sparse(f.join("a.bgeo")),
        Way::Small,
        3,
        "a.bgeo: this is an unknown kind of file, not a BGEO file of version 5",
    ),
    case(
        "4 GiB of nothing as `.vtk`",
        "info a.vtk",
        |f| sparse(f.join("a.vtk")),
        Way::Small,
        3,
        "a.vtk: this is an unknown kind of file, not a legacy VTK file",
    ),
    case(
        "4 GiB of nothing as `.vtu`",
        "info a.vtu",
        |f| sparse(f.join("a.vtu")),
        Way::Small,
        3,
        "a.vtu: this is an unknown kind of file, not VTK's XML format",
    ),
    case(
        "4 GiB of nothing as `.ply`",
        "info a.ply",
        |f| sparse(f.join("a.ply")),
        Way::Small,
        3,
        "a.ply: this is an unknown kind of file, not a PLY file",
    ),
    case(
        "4 GiB of nothing as `.npy`",
        "info a.npy",
        |f| sparse(f.join("a.npy")),
        Way::Small,
        3,
        "a.npy: this is an unknown kind of file, not a NumPy array",
    ),
    case(
        "4 GiB of nothing as `.npz`",
        "info a.npz",
        |f| sparse(f.join("a.npz")),
        Way::Small,
        3,
        "a.npz: this is an unknown kind of file, not an archive of NumPy arrays",
    ),
    case(
        "4 GiB of nothing as `.csv`",
        "info a.csv",
        |f| sparse(f.join("a.csv")),
        Way::Small,
        3,
        "a.csv: no columns x, y and z …",
    ),
    case(
        "4 GiB of nothing as `.xyz`",
        "info a.xyz",
        |f| sparse(f.join("a.xyz")),
        Way::Small,
        4,
        "a.xyz: byte 4294967292: particle 357913941: expected 12 bytes, 4 are left",
    ),
    case(
        "4 GiB of nothing as `.pos`",
        "info a.pos",
        |f| sparse(f.join("a.pos")),
        Way::Small,
        4,
        "a.pos: byte 0: 0 particles need 8 bytes, the file has 4294967296",
    ),
    case(
        "4 GiB of nothing as a scene",
        "info a.toml",
        |f| sparse(f.join("a.toml")),
        Way::Small,
        3,
        "a.toml: the file has 4294967296 bytes, expected at most 67108864",
    ),
    case(
        "4 GiB of nothing as a suite",
        "check a.toml",
        |f| sparse(f.join("a.toml")),
        Way::Small,
        3,
        "a.toml: the file has 4294967296 bytes, expected at most 67108864",
    ),
    case(
        "a suite that is not text",
        "check a.toml",
        |f| write(f.join("a.toml"), b"size = [8, 8]\n\xff"),
        Way::Small,
        4,
        "a.toml: line 2: not text in UTF-8",
    ),
    case(
        "a suite without frames",
        "check a.toml",
        |f| write(f.join("a.toml"), ""),
        Way::Small,
        2,
        "a.toml: …",
    ),
    case(
        "a suite of 100000 brackets",
        "check a.toml",
        |f| write(f.join("a.toml"), format!("a = {}", "[".repeat(100_000))),
        Way::Small,
        2,
        "a.toml: line 1: …",
    ),
    case(
        "a pipe as a suite",
        "check a.toml",
        |f| pipe(&f.join("a.toml")),
        Way::Small,
        4,
        "a.toml: cannot read: this is a pipe or device, expected a file",
    ),
    case(
        "4 GiB of nothing as a picture",
        "compare a.png a.png",
        |f| sparse(f.join("a.png")),
        Way::Small,
        3,
        "a.png: not a PNG…",
    ),
    case(
        "4 GiB of nothing as an environment map",
        "info a.toml",
        |f| {
            write(f.join("a.toml"), "environment.map = \"a.hdr\"");
            sparse(f.join("a.hdr"));
        },
        Way::Small,
        3,
        "a.hdr: not a picture for an environment (HDR, EXR, PNG)…",
    ),
    case(
        "a gzip bomb: 1.25 GiB in 1.3 MB",
        "info a.bgeo",
        |f| write(f.join("a.bgeo"), bomb()),
        Way::Small,
        4,
        "a.bgeo: byte 1073741824: the file unpacks to more than 1073741824 bytes; --max-unpacked MIB allows more",
    ),
    case(
        "the same, allowed: what is in it is no BGEO",
        "info --max-unpacked 1400 a.bgeo",
        |f| write(f.join("a.bgeo"), bomb()),
        Way::Small,
        3,
        "a.bgeo: this is an unknown kind of file, not a BGEO file of version 5",
    ),
    case(
        "a limit of one's own",
        "info --max-unpacked 1 a.bgeo",
        |f| write(f.join("a.bgeo"), files::gzip(&vec![0; 2 << 20])),
        Way::Small,
        4,
        "a.bgeo: byte 1048576: the file unpacks to more than 1048576 bytes; --max-unpacked MIB allows more",
    ),
    case(
        "a thousand VTU pieces that share 4 MiB",
        "info a.vtu",
        |f| write(f.join("a.vtu"), shared_pieces()),
        Way::Small,
        4,
        "a.vtu: byte …: the file unpacks to more than 1073741824 bytes; --max-unpacked MIB allows more",
    ),
    case(
        "200 million nulls of JSON in 200 KB",
        "info a.bgeo",
        |f| write(f.join("a.bgeo"), nulls()),
        Way::Small,
        4,
        "a.bgeo: byte …: the file unpacks to more than 1073741824 bytes; --max-unpacked MIB allows more",
    ),
    case(
        "a list that names 5 million points forty times",
        "info a.pvtu",
        many_names,
        Way::Small,
        4,
        "…p.vtu: byte …: the files that belong together unpack to more than 1073741824 bytes; --max-unpacked MIB allows more",
    ),
    case(
        "five names of one texture of 81 million pixels",
        "info a.toml",
        textured,
        Way::Small,
        4,
        "b2.png: byte 0: the meshes of the document and their pictures take more than 1073741824 bytes; make its pictures smaller",
    ),
    case(
        "thirty images of 81 million pixels in a GLB",
        "info a.toml",
        images,
        Way::Small,
        4,
        "a.glb/images[2]: byte 0: the meshes of the document and their pictures take more than 1073741824 bytes; make its pictures smaller",
    ),
    case(
        "a list that is cut off after an entry",
        "info a.pvtu",
        |f| write(f.join("a.pvtu"), "<VTKFile><PUnstructuredGrid>\n<Piece Source=\"p.vtu\"/>\n"),
        Way::Small,
        4,
        "a.pvtu: byte 53: the list is cut off: <PUnstructuredGrid> has no end",
    ),
    case(
        "a BGEO whose particles take more than its contents",
        "info --max-unpacked 16 a.bgeo",
        |f| many(f, 700_000, "a.bgeo"),
        Way::Small,
        4,
        "a.bgeo: byte …: the file unpacks to more than 16777216 bytes; --max-unpacked MIB allows more",
    ),
    case(
        "an npz whose arrays are too many together",
        "info --max-unpacked 16 a.npz",
        |f| many(f, 400_000, "a.npz"),
        Way::Small,
        4,
        "a.npz (…): byte …: the file unpacks to more than 16777216 bytes; --max-unpacked MIB allows more",
    ),
    case(
        "a blank environment map of 144 million pixels",
        "info a.toml",
        blank_surroundings,
        Way::Small,
        0,
        "",
    ),
    case(
        "the same, to be drawn",
        "render a.toml",
        blank_surroundings,
        Way::Small,
        3,
        "blank.png: 12000x12000 pixels take … MiB of memory, a file of … KiB at most 1024; it seems made to exhaust memory",
    ),
    case(
        "the same, compared with itself",
        "compare blank.png blank.png",
        |f| blank(f, 12_000),
        Way::Small,
        3,
        "blank.png: 12000x12000 pixels take … MiB of memory, a file of … KiB at most 1024; it seems made to exhaust memory",
    ),
    case(
        "pictures of two sizes, one of them huge",
        "compare blank.png a.png",
        |f| {
            blank(f, 12_000);
            two_pictures(f);
        },
        Way::Small,
        3,
        "blank.png and a.png: the reference is 12000x12000 pixels, the test 160x120; render both at one size",
    ),
    case(
        "a slab as thin as nothing, 20 km wide",
        "info a.toml",
        |f| {
            let slab = "[recipe]\nkind = \"slab\"\nmin = [-1e4, 0, -1e4]\nmax = [1e4, 1e-6, 1e4]\ncount = 1000\n";
            write(f.join("a.toml"), slab);
        },
        Way::Small,
        2,
        "recipe: count is 1000: particles would be … m apart, too far for liquid this thin; make count larger or the liquid thicker",
    ),
    case(
        "ten thousand waves in a tank 4 km long",
        "bake a.toml",
        |f| {
            let tank = "[simulation]\nkind = \"swell\"\nframes = 2\nradius = 0.05\n\
                        waves = { count = 10000, wavelengths = [1.0, 9.0], rms_slope = 0.01, seed = 1 }\n\
                        [[simulation.block]]\nmin = [-2000, 0, 0]\nmax = [2000, 1, 1]\n";
            write(f.join("a.toml"), tank);
        },
        Way::Small,
        2,
        "a.toml: [simulation] waves.count is 10000, too many for a block of 40020 particles along its edges: their product may be 100000000",
    ),
    case(
        "an npz member that is longer than it says",
        "info a.npz",
        |f| write(f.join("a.npz"), lying_archive()),
        Way::Small,
        4,
        "a.npz (x.npy): byte …",
    ),
    case(
        "a BGEO that claims 2³¹ − 1 points",
        "info a.bhclassic",
        |f| {
            write(
                f.join("a.bhclassic"),
                [&b"BgeoV"[..], &5_i32.to_be_bytes(), &i32::MAX.to_be_bytes(), &[0; 28]].concat(),
            );
        },
        Way::Small,
        4,
        "a.bhclassic: byte 41: points: expected 2147483647 × 16 bytes, 0 are left",
    ),
    case(
        "a billion points of Houdini, all in one place",
        "info a.geo",
        |f| {
            write(
                f.join("a.geo"),
                "[\"pointcount\",1000000000,\"attributes\",[\"pointattributes\",[[[\"name\",\"P\"],\
                 [\"values\",[\"size\",3,\"pagesize\",1000000000,\"constantpageflags\",[[true]],\
                 \"rawpagedata\",[0,0,0]]]]]]]",
            );
        },
        Way::Small,
        4,
        "a.geo: byte 0: 1000000000 points, more than can be in … bytes",
    ),
    case(
        "a Blosc chunk of 16 bytes that claims 1 GiB",
        "info a.bgeo.sc",
        |f| {
            let sizes = [1_u32 << 30, 1 << 30, 16].map(u32::to_le_bytes);
            let chunk = [&[2, 1, 0, 4], sizes.as_flattened()].concat();
            write(f.join("a.bgeo.sc"), [&b"scf1"[..], &[0; 8], &chunk, &[0; 8], b"1fcs"].concat());
        },
        Way::Small,
        4,
        "a.bgeo.sc: byte 12: expected a Blosc chunk",
    ),
    case(
        "found by fuzzing: `claimed_size.npz`",
        "info claimed_size.npz",
        |f| found(f, "claimed_size.npz"),
        Way::Small,
        0,
        "",
    ),
    case(
        "found by fuzzing: `long_message.vtu`",
        "info long_message.vtu",
        |f| found(f, "long_message.vtu"),
        Way::Small,
        3,
        "long_message.vtu…",
    ),
    case(
        "found by fuzzing: `member_name.npz`",
        "info member_name.npz",
        |f| found(f, "member_name.npz"),
        Way::Small,
        4,
        "member_name.npz…",
    ),
    case(
        "found by fuzzing: `claimed_pixels.png`",
        "compare claimed_pixels.png claimed_pixels.png",
        |f| found(f, "claimed_pixels.png"),
        Way::Small,
        4,
        "claimed_pixels.png: byte 16: …",
    ),
    case(
        "found by fuzzing: `palette.png`",
        "compare palette.png palette.png",
        |f| found(f, "palette.png"),
        Way::Small,
        3,
        "palette.png: a palette of 5 bytes; expected three for each colour",
    ),
    case(
        "found by fuzzing: `claimed_pixels.hdr`",
        "info a.toml",
        |f| {
            write(f.join("a.toml"), "environment.map = \"claimed_pixels.hdr\"");
            found(f, "claimed_pixels.hdr");
        },
        Way::Small,
        3,
        "claimed_pixels.hdr: …",
    ),
    case(
        "found by fuzzing: `claimed_block.exr`",
        "info a.toml",
        |f| {
            write(f.join("a.toml"), "environment.map = \"claimed_block.exr\"");
            found(f, "claimed_block.exr");
        },
        Way::Small,
        3,
        "claimed_block.exr: …",
    ),
    case(
        "a scene that is not text",
        "info a.toml",
        |f| write(f.join("a.toml"), b"\n\xff"),
        Way::Small,
        4,
        "a.toml: line 2: not text in UTF-8",
    ),
    case(
        "a scene of 100000 brackets",
        "info a.toml",
        |f| write(f.join("a.toml"), format!("a = {}", "[".repeat(100_000))),
        Way::Small,
        2,
        "a.toml: line 1: …",
    ),
    case(
        "an environment map that is not there",
        "info a.toml",
        |f| write(f.join("a.toml"), "environment.map = \"b.hdr\""),
        Way::Small,
        4,
        "b.hdr: cannot read: No such file or directory (os error 2)",
    ),
    case("a position: NaN", "info water.xyz", |f| block_and(f, "nan 0 0\n"), Way::Small, 0, ""),
    case("a position: ∞", "info water.xyz", |f| block_and(f, "0 inf 0\n"), Way::Small, 0, ""),
    case(
        "a position: beyond 32-bit floats",
        "info water.xyz",
        |f| block_and(f, "0 0 1e39\n"),
        Way::Small,
        0,
        "",
    ),
    case(
        "positions that are mostly NaN",
        "info a.csv",
        |f| write(f.join("a.csv"), "x,y,z\n0,0,0\n0,nan,0\n0,0,nan\n"),
        Way::Small,
        4,
        "a.csv: line 3: particle 1: position [0.0, NaN, 0.0]; 2 of 3 particles have no finite position below \
         1e18; --skip-invalid leaves them out",
    ),
    case(
        "`radius`: -1",
        "info a.csv",
        |f| write(f.join("a.csv"), "x,y,z,radius\n0,0,0,-1\n"),
        Way::Small,
        0,
        "",
    ),
    case(
        "`radius`: nan",
        "info a.csv",
        |f| write(f.join("a.csv"), "x,y,z,radius\n0,0,0,nan\n"),
        Way::Small,
        0,
        "",
    ),
    case(
        "`density`: inf",
        "info a.csv",
        |f| write(f.join("a.csv"), "x,y,z,density\n0,0,0,inf\n"),
        Way::Small,
        0,
        "",
    ),
    case(
        "`id`: 1.5",
        "info a.csv",
        |f| write(f.join("a.csv"), "x,y,z,id\n0,0,0,1.5\n"),
        Way::Small,
        0,
        "",
    ),
    case(
        "`vx,vy,vz`: 0,nan,0",
        "info a.csv",
        |f| write(f.join("a.csv"), "x,y,z,vx,vy,vz\n0,0,0,0,nan,0\n"),
        Way::Small,
        0,
        "",
    ),
    case(
        "frames with a step of 0",
        "render --frames 1-5x0",
        block,
        Way::Small,
        2,
        "…expected a step of 1 or more…",
    ),
    case(
        "ten million frames and one",
        "render --frames 0-10000000",
        block,
        Way::Small,
        2,
        "…more than 10000000 frames",
    ),
    case(
        "a frame that no integer holds",
        "render --frames 99999999999999999999",
        block,
        Way::Small,
        2,
        "…expected a number, a range …",
    ),
    case(
        "shard 0",
        "render --shard 0/4",
        block,
        Way::Small,
        2,
        "…shard 0/4: expected an index from 1 to the count",
    ),
    case(
        "shard 5 of 4",
        "render --shard 5/4",
        block,
        Way::Small,
        2,
        "…shard 5/4: expected an index from 1 to the count",
    ),
    case(
        "a size of 0",
        "render --size 0x5",
        block,
        Way::Small,
        2,
        "…expected WIDTHxHEIGHT, as 1024x768",
    ),
    case("a camera of NaN", "render --camera eye=nan,0,0", block, Way::Small, 2, "…"),
    case("a setting that is none", "render --set refract.solver=magic", block, Way::Small, 2, "…"),
    case("a setting of ∞", "render --set classify.support=inf", block, Way::Small, 2, "…"),
    case(
        "a radius of NaN",
        "info --radius nan water.xyz",
        block,
        Way::Small,
        2,
        "a particle radius of NaN: expected 1e-12 to 1e12 m",
    ),
    case(
        "a speed of NaN",
        "render --speed nan",
        block,
        Way::Small,
        2,
        "--speed NaN: expected 0.001 to 1000",
    ),
    case(
        "no memory to unpack to",
        "info --max-unpacked 0 water.xyz",
        block,
        Way::Small,
        2,
        "…expected a number of MiB, 1 or more",
    ),
    case("pictures per second: NaN", "render --fps nan", block, Way::Small, 2, "…"),
    case(
        "a full disk: convert",
        "convert water.xyz out/a.ply",
        block,
        Way::Full,
        4,
        "out/a.ply: cannot write: No space left on device (os error 28); free some space, or write elsewhere",
    ),
    case(
        "a full disk: the difference of pictures",
        "compare a.png b.png --diff out/d.png",
        two_pictures,
        Way::Full,
        4,
        "out/d.png: cannot write: …",
    ),
    case(
        "a full disk: bake",
        "bake dam.toml --frames 1 -o out",
        dam,
        Way::Full,
        4,
        "out/dam…: cannot write: No space left on device (os error 28); free some space, or write elsewhere",
    ),
    case(
        "a full disk: render",
        "render water.xyz --size 160x120 -o out/a.png",
        block,
        Way::FullDrawing,
        4,
        "…out/a.png: cannot write: …",
    ),
    case(
        "a full disk: layers",
        "render water.xyz --size 160x120 --aov all -o out/a.png",
        block,
        Way::FullDrawing,
        4,
        "…out/a.aov.exr: cannot write: …",
    ),
    case(
        "a full disk: a film",
        "render water.xyz --turntable 1 --fps 4 --size 160x120 -o out/a.gif",
        block,
        Way::FullDrawing,
        4,
        "…out/a.gif: cannot write: …",
    ),
    case(
        "files of 4 KiB at most: convert",
        "convert water.xyz out/a.ply",
        block,
        Way::Short,
        4,
        "out/a.ply: cannot write: File too large (os error 27)",
    ),
    case(
        "files of 4 KiB at most: the difference of pictures",
        "compare a.png b.png --diff out/d.png",
        two_pictures,
        Way::Short,
        4,
        "out/d.png: cannot write: …",
    ),
    case(
        "files of 4 KiB at most: bake",
        "bake dam.toml --frames 1 -o out",
        dam,
        Way::Short,
        4,
        "out/dam…: cannot write: File too large (os error 27)",
    ),
    case(
        "a device that is full",
        "convert water.xyz full.ply",
        |f| {
            block(f);
            symlink("/dev/full", f.join("full.ply")).unwrap();
        },
        Way::Small,
        4,
        "full.ply: cannot write: No space left on device (os error 28); free some space, or write elsewhere",
    ),
    case(
        "an output folder that is not there",
        "convert water.xyz a.ply/b.ply",
        block,
        Way::Small,
        4,
        "a.ply/b.ply: cannot write: …",
    ),
    case(
        "a picture over its particles",
        "render water.xyz -o water.xyz",
        block,
        Way::Small,
        2,
        "water.xyz: a picture ends in .png, .jpg, .webp or .exr, a film in .mp4, .webm, .gif or .apng",
    ),
    case(
        "a picture over the environment that it shows",
        "render a.toml --scene a.toml -o b.png",
        |f| {
            two_pictures(f);
            block(f);
            write(
                f.join("a.toml"),
                "environment.map = \"b.png\"\nparticles = { source = \"water.xyz\", radius = 0.03 }",
            );
        },
        Way::Small,
        2,
        "b.png: the same command reads this file; choose another name for its output",
    ),
    case(
        "a conversion into its input",
        "convert water.xyz ./water.xyz",
        block,
        Way::Small,
        2,
        "./water.xyz: the same command reads this file; choose another name for its output",
    ),
    case(
        "a difference over one of the pictures",
        "compare a.png b.png --diff b.png",
        two_pictures,
        Way::Small,
        2,
        "b.png: the same command reads this file; choose another name for its output",
    ),
    case(
        "statistics over another program's file",
        "render water.xyz -o out/a.png --stats a.vtk",
        |f| {
            block(f);
            write(f.join("a.vtk"), "# vtk DataFile Version 3.0");
        },
        Way::Small,
        2,
        "a.vtk: this file is not statistics or a report of limpid and is left as it is; choose another name",
    ),
    case(
        "two outputs in one file",
        "render water.xyz -o out/a.png --stats a.json --manifest a.json",
        block,
        Way::Small,
        2,
        "a.json: two outputs of the command would be this file; choose another name",
    ),
    case(
        "an output folder that is mistyped",
        "render water.xyz -o nosuch/a.png",
        block,
        Way::Small,
        4,
        "nosuch/a.png: cannot write: there is no folder nosuch",
    ),
    case(
        "results of a suite over the suite",
        "check a.toml --junit a.toml",
        |f| write(f.join("a.toml"), "[[frame]]\nname = \"a\"\ninput = \"water.xyz\""),
        Way::Small,
        2,
        "a.toml: the same command reads this file; choose another name for its output",
    ),
    case(
        "an expectation outside the suite's folder",
        "check a.toml --bless",
        |f| {
            let text = "[[frame]]\nname = \"a\"\ninput = \"water.xyz\"\nexpected = \"../b.png\"";
            write(f.join("a.toml"), text);
        },
        Way::Small,
        2,
        "a.toml: [[frame]] `a`: expected `../b.png`: expected a path below the suite's folder",
    ),
    case(
        "a pipe as an earlier report",
        "report --against a.json",
        |f| pipe(&f.join("a.json")),
        Way::Small,
        4,
        "a.json: cannot read: this is a pipe or device, expected a file",
    ),
    case(
        "no particles",
        "render a.xyz --size 64x48 -o out/a.png",
        |f| write(f.join("a.xyz"), ""),
        Way::Drawing,
        0,
        "",
    ),
    case(
        "one particle without a radius",
        "render a.xyz --size 64x48 -o out/a.png",
        |f| write(f.join("a.xyz"), "0 0 0"),
        Way::Drawing,
        2,
        "a.xyz: no radii, and no spacing to estimate one from; give --radius",
    ),
    case(
        "one particle",
        "render --radius 0.1 a.xyz --size 64x48 -o out/a.png",
        |f| write(f.join("a.xyz"), "0 0 0"),
        Way::Drawing,
        0,
        "",
    ),
    case(
        "the same particle 10000 times",
        "render --radius 0.1 a.xyz --size 64x48 -o out/a.png",
        |f| write(f.join("a.xyz"), "1 2 3\n".repeat(10_000)),
        Way::Drawing,
        0,
        "",
    ),
    case(
        "a position of 1e30 m",
        "info water.xyz",
        |f| block_and(f, "1e30 0 0\n"),
        Way::Small,
        0,
        "",
    ),
    case(
        "a stray at 1e17 m",
        "render water.xyz --camera \"eye=1,1,2 target=0,0,0 fov_y=40\" --size 64x48 -o out/a.png",
        |f| block_and(f, "1e17 0 0\n"),
        Way::Drawing,
        0,
        "",
    ),
    case(
        "a position that 32-bit floats hold as a denormal",
        "render water.xyz --size 64x48 -o out/a.png",
        |f| block_and(f, "1e-42 0 0\n"),
        Way::Drawing,
        0,
        "",
    ),
    case(
        "a radius of 1e30 m",
        "render --radius 1e30 water.xyz",
        block,
        Way::Small,
        2,
        "a particle radius of …: expected 1e-12 to 1e12 m",
    ),
    case(
        "a radius of 1e-30 m",
        "render --radius 1e-30 water.xyz",
        block,
        Way::Small,
        2,
        "a particle radius of …: expected 1e-12 to 1e12 m",
    ),
    case(
        "a radius of 1e6 m, in a file",
        "render a.csv --camera \"eye=1,1,2 target=0,0,0 fov_y=40\" --size 64x48 -o out/a.png",
        |f| write(f.join("a.csv"), "x,y,z,radius\n0,0,0,1e6\n1,0,0,0.1\n"),
        Way::Drawing,
        0,
        "",
    ),
    case(
        "a radius of 0, in a file",
        "render a.csv --camera \"eye=1,1,2 target=0,0,0 fov_y=40\" --size 64x48 -o out/a.png",
        |f| write(f.join("a.csv"), "x,y,z,radius\n0,0,0,0\n1,0,0,0.1\n"),
        Way::Drawing,
        0,
        "",
    ),
    case(
        "velocities of 1e30 m/s",
        "render a.csv --radius 0.1 --size 64x48 -o out/a.png",
        |f| write(f.join("a.csv"), "x,y,z,vx,vy,vz\n0,0,0,1e30,0,0\n1,0,0,0,-1e30,0\n"),
        Way::Drawing,
        0,
        "",
    ),
    case(
        "one id for all",
        "render a.csv --radius 0.1 --size 64x48 -o out/a.png",
        |f| write(f.join("a.csv"), "x,y,z,id\n0,0,0,7\n1,0,0,7\n"),
        Way::Drawing,
        0,
        "",
    ),
    case(
        "a density of 1e30 and of −1",
        "render a.csv --radius 0.1 --size 64x48 -o out/a.png",
        |f| write(f.join("a.csv"), "x,y,z,density\n0,0,0,1e30\n1,0,0,-1\n"),
        Way::Drawing,
        0,
        "",
    ),
];
