//! Outputs that cannot be written, or are inputs.

use std::os::unix::fs::symlink;

use super::{Case, Way, case};
use crate::prepare::{block, dam, pipe, two_pictures, write};

pub(super) const CASES: &[Case] = &[
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
];
