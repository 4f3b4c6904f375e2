//! Fingerprints: hashes of everything that a picture was made from, stored in the picture.
//!
//! A resumed run skips the pictures that it would draw the same way. A [`Fingerprint`] covers
//! everything that determines the pixels: the resolved scene with its settings and its environment, the
//! camera, the size, the frame time, the origin of the particles, and limpid's version. Particle files
//! are identified by path, length and modification time, since reading all of them would take as long
//! as drawing them.
//!
//! It does not cover the adapter, since the machines of a farm share their work.

use std::fmt;
use std::hash::Hasher as _;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use glam::UVec2;
use rayon::prelude::*;
use siphasher::sip128::{Hasher128 as _, SipHasher24};

use limpid::camera::Camera;
use limpid::environment::Environment;
use limpid::scene::Scene;
use limpid_io::film::Shot;
use limpid_io::input::{FrameTime, Loader, Missing, Origin};
use limpid_io::overlay::Overlay;
use limpid_io::project::SolidMotion;
use limpid_io::{exr, files};

/// Keywords of the text chunks in a PNG.
const FINGERPRINT: &str = "limpid:fingerprint";
const PIXELS: &str = "limpid:pixels";

/// A 128-bit hash of everything that a picture is made from; see [the module](self).
///
/// Computed by `SipHash`-2-4 (Aumasson and Bernstein 2012), which is fast and the same on every
/// platform; it detects mistakes, not forgeries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct Fingerprint(u128);

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl Fingerprint {
    /// Hashes several parts.
    fn over<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> Self {
        let mut hasher = SipHasher24::new();
        for part in parts {
            // The length separates the parts.
            hasher.write(&(part.len() as u64).to_le_bytes());
            hasher.write(part);
        }
        Self(hasher.finish128().as_u128())
    }

    /// The fingerprint of a file that accompanies the picture and also depends on `what`.
    #[must_use]
    pub(crate) fn with(self, what: &str) -> Self {
        Self::over([&self.0.to_le_bytes(), what.as_bytes()])
    }

    /// Whether `path` is a complete OpenEXR file with this fingerprint.
    pub(crate) fn is_of_exr(self, path: &Path) -> bool {
        let (name, text) = self.exr_note();
        exr::is_whole(path, (name, &text))
    }

    /// The attribute of an OpenEXR file with this fingerprint.
    pub(crate) fn exr_note(self) -> (&'static str, String) {
        (FINGERPRINT, self.to_string())
    }

    /// The text chunks of a PNG: the program, the fingerprint, and the checksum of the pixels.
    pub(crate) fn notes(self, pixels: &[u8]) -> [(&'static str, String); 3] {
        [
            ("Software", concat!("limpid ", env!("CARGO_PKG_VERSION")).into()),
            (FINGERPRINT, self.to_string()),
            (PIXELS, format!("{:08x}", checksum(pixels))),
        ]
    }

    /// Whether `path` is a complete PNG of `size` pixels with this fingerprint and unchanged pixels: not
    /// a truncated or damaged file, nor one of another program.
    pub(crate) fn is_of_png(self, path: &Path, size: UVec2) -> bool {
        self.read_png(path, size).is_some()
    }

    /// Reads a PNG; `None` if it is not a complete one of this fingerprint.
    fn read_png(self, path: &Path, size: UVec2) -> Option<()> {
        let file = BufReader::new(files::open(path).ok()?.0);
        let mut reader = png::Decoder::new(file).read_info().ok()?;
        let info = reader.info();
        let note = |keyword: &str| {
            let texts = &info.uncompressed_latin1_text;
            texts.iter().find(|text| text.keyword == keyword).map(|text| text.text.clone())
        };
        let matches = (info.width, info.height) == (size.x, size.y)
            && matches!(info.color_type, png::ColorType::Rgb | png::ColorType::Rgba)
            && info.bit_depth == png::BitDepth::Eight
            && note(FINGERPRINT)? == self.to_string();
        let expected = note(PIXELS).filter(|_| matches)?;
        let mut pixels = vec![0; reader.output_buffer_size()?];
        reader.next_frame(&mut pixels).ok()?;
        reader.finish().ok()?;
        (format!("{:08x}", checksum(&pixels)) == expected).then_some(())
    }
}

/// CRC-32, as in PNG and zlib, of the bytes of 8-bit rows from the top.
pub(crate) fn checksum(pixels: &[u8]) -> u32 {
    let mut crc = flate2::Crc::new();
    crc.update(pixels);
    crc.sum()
}

/// The fingerprints of a run's pictures.
#[derive(Debug, Clone)]
pub(crate) struct Fingerprints {
    /// The part common to all pictures.
    run: Fingerprint,
    /// The part of the particles at each frame time.
    frame_times: Vec<Fingerprint>,
    /// Frame numbers per second, if motion vectors are written, which depend on the picture before.
    moves: Option<f64>,
}

impl Fingerprints {
    /// Computes the fingerprints of pictures of `size` pixels, from the present state of the particle
    /// files of all frame times. `moves` is the number of frame numbers per second, if motion vectors are
    /// written.
    ///
    /// `loader` and `scene` must be resolved, as by [`limpid_io::input::Input::resolve`].
    pub(crate) fn new(
        loader: &Loader,
        frame_times: &[FrameTime],
        scene: &Scene,
        size: UVec2,
        moves: Option<f64>,
    ) -> Self {
        let frame_times = frame_times.par_iter().map(|&at| {
            let origins = loader.origins(at);
            let parts = origins.iter().map(describe);
            let diffuse = loader.diffuse_origins(at);
            let diffuse = diffuse.iter().map(|(origin, drawn)| describe(origin) + drawn);
            let fraction = format!("{:x}", at.fraction.to_bits());
            let motion = loader.motion();
            let motion = motion.map(|motion| describe_motion(motion, at, loader.missing));
            let colors =
                loader.color_by().map(|by| format!("{by:?} {:?}", loader.color_scale().ok()));
            let parts: Vec<String> =
                parts.chain([fraction]).chain(diffuse).chain(motion).chain(colors).collect();
            Fingerprint::over(parts.iter().map(String::as_bytes))
        });
        let run = run_of(scene, size);
        Self { run, frame_times: frame_times.collect(), moves }
    }

    /// As these, of pictures that something is drawn over.
    #[must_use]
    pub(crate) fn under(self, overlay: &Overlay) -> Self {
        match *overlay == Overlay::default() {
            true => self,
            false => Self { run: self.run.with(&format!("{overlay:?}")), ..self },
        }
    }

    /// As these, of pictures that are drawn in `scene`.
    #[must_use]
    pub(crate) fn drawn_in(&self, scene: &Scene, size: UVec2) -> Self {
        Self { run: run_of(scene, size), ..self.clone() }
    }

    /// The fingerprint of a picture.
    ///
    /// # Panics
    /// If the index of its frame time is out of range.
    pub(crate) fn of(&self, shot: &Shot) -> Fingerprint {
        let own = self.at(shot.frame, &shot.camera);
        let Some(rate) = self.moves else { return own };
        let before = shot.before.map(|(frame, camera)| self.at(frame, &camera).to_string());
        own.with(&format!("{before:?} {rate:x}", rate = rate.to_bits()))
    }

    fn at(&self, frame_time: usize, camera: &Camera) -> Fingerprint {
        let particles = self.frame_times[frame_time].0.to_le_bytes();
        let camera = format!("{camera:?}");
        Fingerprint::over([&self.run.0.to_le_bytes()[..], &particles, camera.as_bytes()])
    }
}

/// The part common to all pictures of a scene.
fn run_of(scene: &Scene, size: UVec2) -> Fingerprint {
    let (scene, map) = describe_scene(scene);
    let size = format!("{}x{}", size.x, size.y);
    let version = env!("CARGO_PKG_VERSION").as_bytes();
    Fingerprint::over([version, scene.as_bytes(), map, size.as_bytes()])
}

/// Describes everything in a scene that changes pixels, apart from particles and camera, and returns the
/// radiances of an environment map. [`fmt::Debug`] includes fields that are added later.
fn describe_scene(scene: &Scene) -> (String, &[u8]) {
    let (environment, map) = match &scene.environment {
        Environment::Map { size, pixels } => {
            // A colour with a NaN, which no scene has, encodes the map's size.
            let size = glam::Vec3::new(size.x as f32, size.y as f32, f32::NAN);
            (Environment::Constant(size), bytemuck::cast_slice(pixels))
        }
        other => (other.clone(), &[][..]),
    };
    let scene = Scene { environment, ..scene.clone() };
    (format!("{scene:?}"), map)
}

/// Describes the motion of solids at a frame time; their places at rest belong to the scene.
fn describe_motion(motion: &SolidMotion, at: FrameTime, missing: Missing) -> String {
    let files = motion.files(at, missing).into_iter().map(stamp);
    format!("{at:?} {:?} {}", files.collect::<Vec<_>>(), motion.keys())
}

/// Describes the origin of particles.
fn describe(origin: &Origin<'_>) -> String {
    let Origin { file, parts, section, memory, made, radius, up, scale, map, select } = origin;
    // A .pos file has its ellipsoids in a separate file.
    let ellipsoids = file.filter(|path| path.extension().is_some_and(|e| e == "pos"));
    let ellipsoids = ellipsoids.map(|path| path.with_extension("ani"));
    let files = [file.as_deref(), ellipsoids.as_deref()].map(|path| Some(stamp(path?)));
    let parts: Vec<_> = parts.iter().map(|path| stamp(path)).collect();
    let memory = memory.map(|bytes| Fingerprint::over([bytes]));
    format!(
        "{files:?} {parts:?} {section:?} {memory:?} {made:?} {radius:?} {up:?} {scale:?} {map} {select}"
    )
}

/// Canonical path, length and modification time, ns, of a file that may not exist yet.
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
    use limpid_io::input::Input;
    use limpid_io::particles::ReadOptions;

    /// A picture of other particles of a file, or of other arrays, is another one.
    #[test]
    fn what_is_read_of_a_file_is_part() {
        let described = |select: &str, map: &str| {
            let options = ReadOptions {
                select: select.parse().unwrap(),
                map: map.parse().unwrap(),
                ..ReadOptions::default()
            };
            let input = Input::from_memory(Path::new("a.csv"), "a.csv", b"x,y,z,a,b\n".to_vec());
            let input = input.with_options(&options);
            input.loader.origins(FrameTime::at(0)).iter().map(describe).collect::<Vec<_>>()
        };
        let different = [
            described("all", "radius=a"),
            described("a==1", "radius=a"),
            described("a==2", "radius=a"),
            described("a==1", "radius=b"),
            described("a==1", "radius=a/2"),
        ];
        for (k, one) in different.iter().enumerate() {
            assert!(!different[..k].contains(one), "{one:?}");
        }
    }

    /// `--skip-existing -o PIPE` does not wait for ever: a pipe is not opened to find that it is not a
    /// complete picture.
    #[test]
    #[cfg(unix)]
    fn pipes_are_not_pictures() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe.png");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let fingerprint = Fingerprint::over([&b"anything"[..]]);
        assert!(!fingerprint.is_of_png(&pipe, UVec2::ONE));
        assert!(!fingerprint.is_of_exr(&pipe));
    }
}
