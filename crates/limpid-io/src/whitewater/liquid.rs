//! The liquid that makes whitewater: its frames with velocities, and the survey of the sequence.

use limpid::glam::Vec3;
use limpid::liquid::Particles;
use limpid_sim::whitewater::{self, Flow, Survey, Surveyor};

use super::record::stamp;
use crate::error::Result;
use crate::input::Loader;
use crate::sequence::FrameTime;

/// Frames of a survey, at most, which are spread over the sequence.
const SURVEYED: usize = 24;

/// Frames per second where neither the user nor the files tell.
const FPS: f64 = 30.0;

/// One frame of liquid.
pub(super) struct Liquid {
    pub(super) particles: Particles,
    velocities: Vec<Vec3>,
    pub(super) flow: Flow,
}

/// Reads the liquid.
pub(super) struct Reader<'a> {
    loader: &'a Loader,
    numbers: Vec<i64>,
    /// Radius of the particles, m.
    radius: f32,
    /// Length of a frame, s.
    pace: f64,
}

impl<'a> Reader<'a> {
    /// As of a sequence that was surveyed before.
    pub(super) fn at(loader: &'a Loader, radius: f32, pace: f64) -> Result<Self> {
        let numbers = loader.sequence.frames.iter().map(|frame| frame.number).collect();
        Ok(Self { loader, numbers, radius, pace })
    }

    /// Finds the radius of the particles and the time between frames.
    pub(super) fn new(loader: &'a Loader) -> Result<Self> {
        let mut reader = Self::at(loader, 0.0, 1.0 / FPS)?;
        let mut problem = None;
        for &number in &reader.numbers {
            match reader.particles(number) {
                Ok(particles) if particles.is_empty() => {}
                Ok(particles) => {
                    reader.radius = loader.radius(FrameTime::at(number), &particles)?;
                    break;
                }
                Err(error) if error.is_of_reading() => {
                    problem.get_or_insert(error);
                }
                Err(error) => return Err(error),
            }
        }
        if let Some(problem) = problem.filter(|_| reader.radius == 0.0) {
            return Err(problem);
        }
        reader.pace = match loader.fps() {
            Some(fps) => 1.0 / fps,
            None => reader.measured_pace().unwrap_or(1.0 / FPS),
        };
        Ok(reader)
    }

    pub(super) fn loader(&self) -> &'a Loader {
        self.loader
    }

    pub(super) fn numbers(&self) -> &[i64] {
        &self.numbers
    }

    pub(super) fn pace(&self) -> f64 {
        self.pace
    }

    /// Length and time of the files of a frame's liquid, to see whether they change.
    pub(super) fn stamp(&self, number: i64) -> String {
        let files = self.loader.files_at(FrameTime::at(number));
        files.map(stamp).collect::<Vec<_>>().join(" ")
    }

    /// Time from the frame before one to it, s.
    pub(super) fn seconds(&self, index: usize) -> f32 {
        let frames = match index.checked_sub(1) {
            Some(before) => self.numbers[index].abs_diff(self.numbers[before]) as f64,
            None => self.loader.sequence.stride() as f64,
        };
        (self.pace * frames / self.loader.sequence.stride() as f64) as f32
    }

    fn particles(&self, number: i64) -> Result<Particles> {
        self.loader.particles(FrameTime::at(number))
    }

    /// The frame of this index. Velocities that its file lacks are estimated from the frame before, of the first from the
    /// next; without any it stands still.
    pub(super) fn liquid(&self, index: usize) -> Result<Liquid> {
        let particles = self.particles(self.numbers[index])?;
        let velocities = match particles.velocities.clone() {
            Some(velocities) => velocities,
            None => self.estimated(index, &particles),
        };
        let flow = Flow::new(&particles, &velocities, self.radius.max(f32::MIN_POSITIVE));
        Ok(Liquid { particles, velocities, flow })
    }

    fn estimated(&self, index: usize, particles: &Particles) -> Vec<Vec3> {
        let (other, seconds) = match index.checked_sub(1) {
            Some(before) => (Some(before), self.seconds(index)),
            None => (Some(1), -self.seconds(1.min(self.numbers.len() - 1))),
        };
        let number = other.and_then(|other| self.numbers.get(other));
        let found = number.and_then(|&number| {
            whitewater::velocities(&self.particles(number).ok()?, particles, seconds)
        });
        found.unwrap_or_else(|| vec![Vec3::ZERO; particles.len()])
    }

    /// Indices of some frames, which are spread over the sequence, that have a frame before.
    fn some(&self, most: usize) -> impl Iterator<Item = usize> {
        let last = self.numbers.len().saturating_sub(1);
        let count = last.min(most);
        (1..=count).map(move |k| k * last / count)
    }

    /// Time between frames by the displacements of particles with velocities.
    fn measured_pace(&self) -> Option<f64> {
        const FEW: usize = 8;
        let stride = self.loader.sequence.stride() as f64;
        let pace = |index: usize| {
            let [a, b] = [index - 1, index].map(|index| self.numbers[index]);
            let seconds = whitewater::duration(&self.particles(a).ok()?, &self.particles(b).ok()?)?;
            Some(f64::from(seconds) * stride / a.abs_diff(b) as f64)
        };
        let mut all: Vec<f64> = self.some(FEW).filter_map(pace).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    }

    /// Measures the sequence by some of its frames. Unreadable ones are left out.
    pub(super) fn survey(&self) -> Result<Survey> {
        let mut surveyor = Surveyor::new(self.radius.max(f32::MIN_POSITIVE));
        for index in self.some(SURVEYED) {
            let (before, after) = match (self.liquid(index - 1), self.liquid(index)) {
                (Ok(before), Ok(after)) => (before, after),
                (Err(error), _) | (_, Err(error)) if error.is_of_reading() => continue,
                (Err(error), _) | (_, Err(error)) => return Err(error),
            };
            let Some(bounds) = after.particles.bounds() else { continue };
            let falls = whitewater::falls(
                (&before.particles, &before.velocities),
                (&after.particles, &after.velocities),
                self.seconds(index),
            );
            let potentials = Surveyor::potentials(&after.flow);
            surveyor.add(&after.flow, bounds, &potentials, &falls);
        }
        Ok(surveyor.finish())
    }
}
