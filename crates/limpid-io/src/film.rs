//! Films: the list of their pictures, and the encoders for their files.

mod ffmpeg;

use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use glam::UVec2;
use image::RgbImage;

use crate::camera_path::CameraPath;
use crate::error::{Error, Result};
use crate::frames::check_fps;
use crate::output::{FileKind, Temporary};
use ffmpeg::Ffmpeg;
use limpid::camera::Camera;

/// Largest number of pictures of a film; more are taken for a typing error.
pub const MAX_SHOTS: f64 = 1e7;

/// Highest frame rate of a GIF: viewers slow down delays below 2/100 s.
const MAX_GIF_FPS: f64 = 50.0;

/// The camera motion of a film.
#[derive(Debug, Clone, PartialEq)]
pub enum Motion {
    /// A fixed camera.
    Still,
    /// A camera path.
    Path(CameraPath),
    /// A rotation about the target; the value is the duration of a full turn, s.
    Turntable(f64),
    /// One picture of a single frame from each of these cameras.
    Views(Vec<Camera>),
}

/// One picture of a film.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shot {
    /// Number in the file name: that of the particle frame, or, if there are more pictures than particle
    /// frames, that of the picture, from 1.
    pub number: i64,
    /// Index of the particle frame, from 0.
    pub frame: usize,
    /// The camera.
    pub camera: Camera,
    /// Particle frame and camera of the picture before; `None` for the first.
    pub before: Option<(usize, Camera)>,
}

/// Lists the pictures of a film of the particle frames `numbers`, played at `fps` frames per second with
/// a moving camera.
///
/// A sequence is played once, and a path starts at 0 s with the first picture. With a single particle
/// frame the film is as long as the path, with the last picture at the path's end. A turntable makes one
/// full turn, so that the film loops without a seam: a shorter sequence repeats, and during a longer one
/// the camera keeps turning. Views are pictures of a single particle frame.
///
/// # Errors
/// [`Error::Usage`] for a rate or a turn that is not above 0 and finite, for too many pictures, or for views of several
/// frames.
pub fn shots(numbers: &[i64], camera: Camera, motion: &Motion, fps: f64) -> Result<Vec<Shot>> {
    check_fps(fps)?;
    if let Motion::Views(views) = motion {
        if numbers.len() != 1 {
            let problem = format!("views of {} frames; expected one frame", numbers.len());
            return Err(Error::Usage(problem));
        }
        let shots = (1..).zip(views).map(|(number, &camera)| Shot {
            number,
            frame: 0,
            camera,
            before: None,
        });
        return Ok(shots.collect());
    }
    let count = match motion {
        Motion::Path(path) if numbers.len() == 1 => (path.duration() * fps + 1e-6).floor() + 1.0,
        Motion::Turntable(seconds) if !(*seconds > 0.0 && seconds.is_finite()) => {
            let problem = "expected a finite number above 0";
            return Err(Error::Usage(format!("a turn of {seconds} seconds: {problem}")));
        }
        Motion::Turntable(seconds) if !numbers.is_empty() => (seconds * fps).round().max(1.0),
        _ => 0.0,
    };
    if count > MAX_SHOTS {
        return Err(Error::Usage(format!(
            "{count:.0} pictures; expected fewer seconds or frames per second"
        )));
    }
    let count = count as usize;
    let at = |i: usize| {
        let camera = match motion {
            Motion::Still | Motion::Views(_) => camera,
            Motion::Path(path) => path.at(i as f64 / fps),
            Motion::Turntable(_) => {
                camera.turned((i % count) as f64 / count as f64 * std::f64::consts::TAU)
            }
        };
        (i % numbers.len(), camera)
    };
    let shots = (0..count.max(numbers.len())).map(|i| {
        let (frame, camera) = at(i);
        let number = if count > numbers.len() { i as i64 + 1 } else { numbers[frame] };
        Shot { number, frame, camera, before: i.checked_sub(1).map(at) }
    });
    Ok(shots.collect())
}

/// The film formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FilmFormat {
    /// H.264 in MPEG-4 (`.mp4`), which plays nearly anywhere; written by `ffmpeg`.
    Mp4,
    /// VP9 in WebM (`.webm`), for the web; written by `ffmpeg`.
    Webm,
    /// GIF (`.gif`): 256 colours per frame, looping.
    Gif,
    /// Animated PNG (`.apng`): lossless, looping.
    Apng,
}

impl FilmFormat {
    /// The format of a file's extension, if it is that of a film.
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "mp4" => Some(Self::Mp4),
            "webm" => Some(Self::Webm),
            "gif" => Some(Self::Gif),
            "apng" => Some(Self::Apng),
            _ => None,
        }
    }
}

/// A film being written.
///
/// It is written to a temporary file beside its own, and renamed by [`Film::finish`]. If it is dropped
/// before, the temporary file is removed.
pub struct Film {
    path: PathBuf,
    size: UVec2,
    fps: f64,
    frames: u32,
    // Declared before the file, so that the encoder has ended when the file is removed.
    encoder: Encoder,
    file: Temporary,
}

enum Encoder {
    Ffmpeg(Ffmpeg),
    Gif(Box<gif::Encoder<BufWriter<File>>>),
    Apng(Box<png::Writer<BufWriter<File>>>),
}

impl Film {
    /// Begins a film of pictures of `size` pixels at `fps` frames per second. The extension of `path`
    /// selects the format.
    ///
    /// MP4 and WebM are 8-bit 4:2:0 video in ITU-R BT.709, visually close to lossless. Their width and
    /// height must be even, since chroma is subsampled by two.
    ///
    /// # Errors
    /// [`Error::Usage`] for an extension, a size or a rate that the format does not support;
    /// [`Error::Io`] if the file cannot be written, or if `ffmpeg` is needed and not on `PATH`.
    pub fn create(path: &Path, size: UVec2, fps: f64) -> Result<Self> {
        let name = path.display();
        let usage = |problem: String| Err(Error::Usage(format!("{name}: {problem}")));
        let Some(kind) = FilmFormat::of(path) else {
            return usage("a film ends in .mp4, .webm, .gif or .apng".into());
        };
        check_fps(fps)?;
        let UVec2 { x, y } = size;
        match kind {
            FilmFormat::Mp4 | FilmFormat::Webm if x % 2 + y % 2 > 0 => {
                let (x2, y2) = (x.next_multiple_of(2), y.next_multiple_of(2));
                return usage(format!(
                    "video of {x}x{y} pixels needs an even width and height; {x2}x{y2} is nearest"
                ));
            }
            FilmFormat::Gif if size.max_element() > u32::from(u16::MAX) => {
                return usage(format!("{x}x{y} pixels; a GIF has at most 65535 a side"));
            }
            FilmFormat::Gif if fps > MAX_GIF_FPS => {
                return usage(format!(
                    "GIFs of more than {MAX_GIF_FPS} frames per second are slowed down by most \
                     viewers; write an .apng, or fewer than {fps}"
                ));
            }
            _ if size.min_element() == 0 => {
                return usage(format!("{x}x{y} pixels: expected at least 1x1"));
            }
            _ => {}
        }
        FileKind::FILM.check(path)?;
        // A film is patched at its end, which pipes and devices do not support.
        if path.metadata().is_ok_and(|metadata| !metadata.is_file()) {
            return Err(Error::io(path, "write", io::Error::other("not a regular file")));
        }
        let fail = |e: io::Error| Error::io(path, "write", e);
        let file = Temporary::beside(path)?;
        let buffer = || file.as_file().try_clone().map(BufWriter::new).map_err(fail);
        let encoder = match kind {
            FilmFormat::Mp4 | FilmFormat::Webm => Encoder::Ffmpeg(
                Ffmpeg::start(kind, file.path(), size, fraction(fps)).map_err(fail)?,
            ),
            FilmFormat::Gif => {
                let (x, y) = (x as u16, y as u16);
                let mut encoder = gif::Encoder::new(buffer()?, x, y, &[])
                    .map_err(|e| fail(io::Error::other(e)))?;
                encoder.set_repeat(gif::Repeat::Infinite).map_err(|e| fail(io::Error::other(e)))?;
                Encoder::Gif(Box::new(encoder))
            }
            FilmFormat::Apng => {
                let encoder = apng(buffer()?, size, fps).map_err(|e| fail(io::Error::other(e)))?;
                Encoder::Apng(Box::new(encoder))
            }
        };
        Ok(Self { path: path.to_owned(), size, fps, frames: 0, encoder, file })
    }

    /// Path of the finished film.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Appends an 8-bit sRGB picture.
    ///
    /// # Errors
    /// [`Error::Mismatch`] if its size differs from the film's; [`Error::Io`] if it cannot be written.
    pub fn push(&mut self, picture: &RgbImage) -> Result<()> {
        let UVec2 { x, y } = self.size;
        if picture.dimensions() != (x, y) {
            let (width, height) = picture.dimensions();
            let name = self.path.display();
            let problem = format!("{name}: a picture of {width}x{height} in a film of {x}x{y}");
            return Err(Error::Mismatch(problem));
        }
        let written = match &mut self.encoder {
            Encoder::Ffmpeg(ffmpeg) => ffmpeg.push(picture),
            Encoder::Gif(encoder) => {
                // Times are rounded, not delays, so that rounding errors do not accumulate.
                let time = |frame: u32| (f64::from(frame) * 100.0 / self.fps).round();
                let delay = (time(self.frames + 1) - time(self.frames)) as u16;
                let frame = gif::Frame::from_rgb_speed(x as u16, y as u16, picture, 10);
                encoder.write_frame(&gif::Frame { delay, ..frame }).map_err(io::Error::other)
            }
            Encoder::Apng(encoder) => encoder.write_image_data(picture).map_err(io::Error::other),
        };
        written.map_err(|e| Error::io(&self.path, "write", e))?;
        self.frames += 1;
        Ok(())
    }

    /// Completes the file and renames it to the film's path.
    ///
    /// # Errors
    /// [`Error::Usage`] for a film without pictures, [`Error::Io`] if it cannot be written.
    pub fn finish(self) -> Result<()> {
        let Self { path, frames, encoder, file, .. } = self;
        if frames == 0 {
            return Err(Error::Usage(format!("{}: a film without pictures", path.display())));
        }
        let written = match encoder {
            Encoder::Ffmpeg(ffmpeg) => ffmpeg.finish(),
            Encoder::Gif(encoder) => {
                encoder.into_inner().map_err(io::Error::other).and_then(|mut file| file.flush())
            }
            Encoder::Apng(encoder) => encoder
                .finish()
                .map_err(io::Error::other)
                .and_then(|()| count_apng_frames(file.as_file(), frames)),
        };
        let whole = written.and_then(|()| match file.as_file().metadata()?.len() {
            0 => Err(io::Error::other("nothing was written")),
            _ => Ok(()),
        });
        whole.map_err(|e| Error::io(&path, "write", e))?;
        file.keep(&path)
    }
}

/// Begins an animated PNG with a placeholder for the number of frames; see [`count_apng_frames`].
fn apng(
    out: BufWriter<File>,
    size: UVec2,
    fps: f64,
) -> Result<png::Writer<BufWriter<File>>, png::EncodingError> {
    let mut encoder = png::Encoder::new(out, size.x, size.y);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_animated(i32::MAX as u32, 0)?;
    let (frames, seconds) = fraction(fps);
    encoder.set_frame_delay(seconds, frames)?;
    encoder.write_header()
}

/// Writes the number of frames to the animation control chunk, which follows signature and header.
fn count_apng_frames(mut file: &File, frames: u32) -> io::Result<()> {
    const SIGNATURE: u64 = 8;
    const HEADER: u64 = 4 + 4 + 13 + 4;
    let mut chunk = *b"acTL\0\0\0\0\0\0\0\0";
    chunk[4..8].copy_from_slice(&frames.to_be_bytes());
    let mut crc = flate2::Crc::new();
    crc.update(&chunk);
    file.seek(SeekFrom::Start(SIGNATURE + HEADER + 4))?;
    file.write_all(&chunk)?;
    file.write_all(&crc.sum().to_be_bytes())
}

/// Approximates a rate by a fraction of 16-bit numbers: the last convergent of its continued fraction
/// that fits, which is exact for all common rates.
fn fraction(fps: f64) -> (u16, u16) {
    let (mut before, mut best) = ((0_u64, 1_u64), (1, 0));
    let mut rest = fps;
    loop {
        let whole = rest.floor();
        let next = (whole as u64 * best.0 + before.0, whole as u64 * best.1 + before.1);
        let (Ok(frames), Ok(seconds)) = (u16::try_from(next.0), u16::try_from(next.1)) else {
            return (best.0 as u16, best.1 as u16);
        };
        let error = (f64::from(frames) / f64::from(seconds) - fps).abs();
        if error <= 1e-9 * fps {
            return (frames, seconds);
        }
        (before, best) = (best, next);
        rest = 1.0 / (rest - whole);
    }
}
