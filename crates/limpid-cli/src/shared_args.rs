//! Options shared by several commands.

use glam::UVec2;
use limpid_io::particles::{AttributeMap, ReadOptions};

// Options of all commands that read particles; a doc comment here would become their help.
#[derive(clap::Args)]
pub(crate) struct Reading {
    /// Memory limit of one unpacked particle file, MiB [default: 100 times its length, but 1024 to
    /// 16384].
    #[arg(long, value_name = "MIB", value_parser = parse_mib)]
    max_unpacked: Option<u64>,
    /// Read attributes (velocity, density, radius, id, ellipsoid) from arrays with unusual names:
    /// velocity=U,radius=h. `limpid info` lists the arrays.
    #[arg(long, value_name = "ATTRIBUTE=ARRAY,...")]
    map: Option<AttributeMap>,
}

impl Reading {
    pub(crate) fn options(&self) -> ReadOptions {
        let map = self.map.clone().unwrap_or_default();
        ReadOptions { max_unpacked: self.max_unpacked, map }
    }
}

/// Parses a number of MiB; returns bytes.
fn parse_mib(text: &str) -> Result<u64, &'static str> {
    let mib = text.parse().ok().filter(|mib| (1..1 << 40).contains(mib));
    mib.map(|mib: u64| mib << 20).ok_or("expected a number of MiB, 1 or more")
}

/// Parses a size in pixels such as `1024x768`.
pub(crate) fn parse_size(text: &str) -> Result<UVec2, String> {
    let parse = || {
        let (width, height) = text.split_once(['x', 'X'])?;
        Some(UVec2::new(width.parse().ok()?, height.parse().ok()?))
    };
    parse().filter(|size| size.min_element() > 0).ok_or("expected WIDTHxHEIGHT, as 1024x768".into())
}
