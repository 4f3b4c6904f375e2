//! The command line of the benches that draw frames.

use std::env;

use glam::UVec2;

/// Command-line options.
pub(crate) struct Options {
    /// Inputs that the bench draws: names of its own, or scene files.
    pub(crate) chosen: Vec<String>,
    pub(crate) settings: Vec<String>,
    pub(crate) frames: usize,
    pub(crate) size: UVec2,
}

impl Options {
    /// Parses the command line, to which `cargo bench` adds `--bench`: names, `frames=N`, `size=WIDTHxHEIGHT`,
    /// and settings. Without names, `all` are chosen.
    pub(crate) fn parse(all: &[&str], frames: usize) -> Self {
        let mut options =
            Self { chosen: Vec::new(), settings: Vec::new(), frames, size: UVec2::new(1024, 768) };
        for arg in env::args().skip(1).filter(|arg| !arg.starts_with('-')) {
            match arg.split_once('=') {
                Some(("frames", n)) => options.frames = n.parse().expect("a number of frames"),
                Some(("size", size)) => {
                    let sides = size.split_once('x').expect("WIDTHxHEIGHT");
                    let side = |text: &str| text.parse().expect("a number of pixels");
                    options.size = UVec2::new(side(sides.0), side(sides.1));
                }
                Some(_) => options.settings.push(arg),
                None => options.chosen.push(arg),
            }
        }
        if options.chosen.is_empty() {
            options.chosen = all.iter().copied().map(str::to_owned).collect();
        }
        assert!(options.frames > 0, "at least one frame expected");
        options
    }
}
