//! What a picture was made from, as a number that is kept in the picture.
//!
//! A run that is resumed leaves those pictures alone that it would draw the same way. A
//! [`Fingerprint`] is over everything that decides the pixels: the settled scene with its settings
//! and its environment, the camera, the size, the moment, where the particles come from, and
//! limpid's version. Particle files are known by their path, their length and their time of
//! modification; to read all of them would take as long as to draw them.
//!
//! The adapter is not in it: the machines of a farm share their work.

use std::fmt;
use std::hash::Hasher as _;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use glam::UVec2;
use image::RgbImage;
use rayon::prelude::*;
use siphasher::sip128::{Hasher128 as _, SipHasher24};

use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::scene::Scene;
use limpid_io::input::{FrameTime, Input, Origin};
use limpid_io::{exr, files};

/// Keywords of the texts in a PNG.
const FINGERPRINT: &str = "limpid:fingerprint";
const PIXELS: &str = "limpid:pixels";

/// 128 bits that differ if what a picture is made from differs; see the module.
///
/// By `SipHash`-2-4 (Aumasson and Bernstein 2012), which is fast and the same everywhere; it keeps
/// mistakes apart, not forgers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Fingerprint(u128);

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl Fingerprint {
    /// That of several things together.
    fn over<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> Self {
        let mut hasher = SipHasher24::new();
        for part in parts {
            // Where one part ends matters.
            hasher.write(&(part.len() as u64).to_le_bytes());
            hasher.write(part);
        }
        Self(hasher.finish128().as_u128())
    }

    /// The fingerprint of a file that comes with the picture and depends on `what` besides.
    #[must_use]
    pub(crate) fn with(self, what: &str) -> Self {
        Self::over([&self.0.to_le_bytes(), what.as_bytes()])
    }

    /// Whether `path` is a whole `OpenEXR` file that was made from this.
    pub(crate) fn is_of_exr(self, path: &Path) -> bool {
        let (name, text) = self.exr_note();
        exr::is_whole(path, (name, &text))
    }

    /// What an `OpenEXR` file is to say.
    pub(crate) fn exr_note(self) -> (&'static str, String) {
        (FINGERPRINT, self.to_string())
    }

    /// What a PNG is to say: the program, the fingerprint, and the checksum of the pixels.
    pub(crate) fn notes(self, picture: &RgbImage) -> [(&'static str, String); 3] {
        [
            ("Software", concat!("limpid ", env!("CARGO_PKG_VERSION")).into()),
            (FINGERPRINT, self.to_string()),
            (PIXELS, format!("{:08x}", checksum(picture))),
        ]
    }

    /// Whether `path` is a whole PNG of `size` pixels that was made from this, with the pixels that
    /// it was made with: no truncated or damaged file, none of another program.
    pub(crate) fn is_of_png(self, path: &Path, size: UVec2) -> bool {
        self.read_png(path, size).is_some()
    }

    fn read_png(self, path: &Path, size: UVec2) -> Option<()> {
        let file = BufReader::new(files::open(path).ok()?.0);
        let mut reader = png::Decoder::new(file).read_info().ok()?;
        let info = reader.info();
        let note = |keyword: &str| {
            let texts = &info.uncompressed_latin1_text;
            texts.iter().find(|text| text.keyword == keyword).map(|text| text.text.clone())
        };
        let whole = (info.width, info.height) == (size.x, size.y)
            && (info.color_type, info.bit_depth) == (png::ColorType::Rgb, png::BitDepth::Eight)
            && note(FINGERPRINT)? == self.to_string();
        let expected = note(PIXELS).filter(|_| whole)?;
        let mut pixels = vec![0; reader.output_buffer_size()?];
        reader.next_frame(&mut pixels).ok()?;
        reader.finish().ok()?;
        (format!("{:08x}", checksum(&pixels)) == expected).then_some(())
    }
}

/// CRC-32 of 8-bit RGB rows from the top: that of PNG and zlib.
pub(crate) fn checksum(pixels: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(pixels);
    crc.sum()
}

/// The fingerprints of a run's pictures.
#[derive(Debug, Clone)]
pub(crate) struct Fingerprints {
    /// What all of them have in common.
    run: Fingerprint,
    /// That of each moment's particles.
    frame_times: Vec<Fingerprint>,
}

impl Fingerprints {
    /// For pictures of `size` pixels: looks at the particle files of all frame times, as they are now.
    ///
    /// `input` and `scene` are settled ([`Input::resolve`]).
    pub(crate) fn new(
        input: &Input,
        frame_times: &[FrameTime],
        scene: &Scene,
        size: UVec2,
    ) -> Self {
        let frame_times = frame_times.par_iter().map(|&at| {
            let origins = input.origins(at);
            let told = origins.iter().map(tell);
            let told: Vec<String> = told.chain([format!("{:x}", at.fraction.to_bits())]).collect();
            Fingerprint::over(told.iter().map(String::as_bytes))
        });
        let (look, map) = look(scene);
        let size = format!("{}x{}", size.x, size.y);
        let version = env!("CARGO_PKG_VERSION").as_bytes();
        let run = Fingerprint::over([version, look.as_bytes(), map, size.as_bytes()]);
        Self { run, frame_times: frame_times.collect() }
    }

    /// That of the picture of a moment, counted from 0, seen from `camera`.
    ///
    /// # Panics
    /// If there are not so many frame times.
    pub(crate) fn of(&self, moment: usize, camera: &Camera) -> Fingerprint {
        let moment = self.frame_times[moment].0.to_le_bytes();
        let camera = format!("{camera:?}");
        Fingerprint::over([&self.run.0.to_le_bytes()[..], &moment, camera.as_bytes()])
    }
}

/// Everything in a scene that changes pixels apart from particles and camera: what will be added
/// to scenes too, since [`fmt::Debug`] leaves nothing out. Of an environment map the radiances.
fn look(scene: &Scene) -> (String, &[u8]) {
    let (environment, map) = match &scene.environment {
        Environment::Map { size, pixels } => {
            // Its size is told by a colour that nothing else has.
            let size = glam::Vec3::new(size.x as f32, size.y as f32, f32::NAN);
            (Environment::Constant(size), bytemuck::cast_slice(pixels))
        }
        other => (other.clone(), &[][..]),
    };
    let scene = Scene { environment, ..scene.clone() };
    (format!("{scene:?}"), map)
}

/// Where particles come from.
fn tell(origin: &Origin<'_>) -> String {
    let Origin { file, made, radius, up, map } = origin;
    // Ellipsoids lie in a file of their own.
    let ellipsoids = file.filter(|path| path.extension().is_some_and(|e| e == "pos"));
    let ellipsoids = ellipsoids.map(|path| path.with_extension("ani"));
    let files = [file.as_deref(), ellipsoids.as_deref()].map(|path| Some(stamp(path?)));
    format!("{files:?} {made:?} {radius:?} {up:?} {map}")
}

/// Path, length and time of modification, ns, of a file that may not be there yet. The path is the
/// same however the file is named.
fn stamp(path: &Path) -> (PathBuf, u64, u128) {
    let (length, time) = path.metadata().map_or((0, 0), |metadata| {
        let time = metadata.modified().ok().and_then(|t| t.duration_since(UNIX_EPOCH).ok());
        (metadata.len(), time.map_or(0, |time| time.as_nanos()))
    });
    (path.canonicalize().unwrap_or_else(|_| path.to_owned()), length, time)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Protects `--skip-existing -o PIPE` from waiting for ever: what is no file is no whole picture,
    /// which is known without opening it.
    #[test]
    #[cfg(unix)]
    fn pipes_are_no_pictures() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe.png");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let fingerprint = Fingerprint::over([&b"anything"[..]]);
        assert!(!fingerprint.is_of_png(&pipe, UVec2::ONE));
        assert!(!fingerprint.is_of_exr(&pipe));
    }
}
