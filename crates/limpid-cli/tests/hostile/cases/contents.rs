//! Contents that are damaged, or larger than a file justifies.

use super::{Case, Way, case};
use crate::files;
use crate::prepare::{
    blank, blank_surroundings, bomb, found, images, lying_archive, many, many_names, nulls, pipe,
    shared_pieces, sparse, textured, two_pictures, write,
};

pub(super) const CASES: &[Case] = &[
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
];
