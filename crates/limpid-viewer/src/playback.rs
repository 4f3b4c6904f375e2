//! Which moment of a sequence is shown, and when the next one is.

use std::time::Duration;

/// Playback over `count` frame times.
///
/// It shows every moment in turn and waits for one that is not loaded yet, so a slow machine plays
/// slowly and leaves nothing out. At speeds above 1 it takes several frames at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Playback {
    /// Whether time runs.
    pub playing: bool,
    /// Whether it runs towards the first moment.
    pub backwards: bool,
    /// Whether it goes on at the other end.
    pub looped: bool,
    /// Frames of the sequence per second at speed 1.
    pub fps: f64,
    speed: Speed,
    index: usize,
    count: usize,
    /// The share of the present moment's time that has passed, up to 1.
    phase: f64,
}

/// How fast a sequence is played.
///
/// Below 1 are slow motions, for which frame times between the frames are interpolated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Speed {
    /// One eighth.
    Eighth,
    /// One quarter.
    Quarter,
    /// One half.
    Half,
    /// As the simulation ran.
    #[default]
    Real,
    /// Every second frame.
    Double,
    /// Every fourth frame.
    Quadruple,
}

impl Speed {
    /// All of them, the slowest first.
    pub const ALL: [Self; 6] =
        [Self::Eighth, Self::Quarter, Self::Half, Self::Real, Self::Double, Self::Quadruple];

    /// Frames of the sequence from one moment to the next: 1, or less where frame times between are
    /// interpolated.
    pub fn step(self) -> f64 {
        match self {
            Self::Eighth => 0.125,
            Self::Quarter => 0.25,
            Self::Half => 0.5,
            Self::Real | Self::Double | Self::Quadruple => 1.0,
        }
    }

    /// Moments that playback goes on by at a time.
    pub fn stride(self) -> usize {
        match self {
            Self::Double => 2,
            Self::Quadruple => 4,
            _ => 1,
        }
    }

    /// As it is shown.
    pub fn label(self) -> &'static str {
        match self {
            Self::Eighth => "1/8 ×",
            Self::Quarter => "1/4 ×",
            Self::Half => "1/2 ×",
            Self::Real => "1 ×",
            Self::Double => "2 ×",
            Self::Quadruple => "4 ×",
        }
    }

    /// The next in [`Speed::ALL`], or the one before; the ends stay.
    #[must_use]
    pub fn next(self, faster: bool) -> Self {
        let at = Self::ALL.iter().position(|&speed| speed == self).unwrap_or_default();
        let to = if faster { at + 1 } else { at.saturating_sub(1) };
        Self::ALL[to.min(Self::ALL.len() - 1)]
    }
}

impl Playback {
    /// Paused at the first of `count` frame times of a sequence with `fps` frames per second.
    pub fn new(count: usize, fps: f64) -> Self {
        Self {
            playing: false,
            backwards: false,
            looped: true,
            fps,
            speed: Speed::Real,
            index: 0,
            count,
            phase: 0.0,
        }
    }

    /// The moment shown.
    pub fn index(&self) -> usize {
        self.index
    }

    /// The number of frame times.
    pub fn count(&self) -> usize {
        self.count
    }

    /// How fast it plays.
    pub fn speed(&self) -> Speed {
        self.speed
    }

    /// What playback goes on by, as a cache wants to know it.
    pub fn step(&self) -> isize {
        let stride = self.speed.stride() as isize;
        if self.backwards { -stride } else { stride }
    }

    /// Goes to a moment; one beyond the last is the last.
    pub fn seek(&mut self, index: usize) {
        self.index = index.min(self.count.saturating_sub(1));
        self.phase = 0.0;
    }

    /// Goes on by one moment, or back, and pauses.
    pub fn step_by(&mut self, forwards: bool) {
        self.playing = false;
        let to = match forwards {
            true => (self.index + 1).checked_rem(self.count),
            false => self.index.checked_sub(1).or(self.count.checked_sub(1)),
        };
        self.seek(to.unwrap_or(0));
    }

    /// Replaces the frame times by those of another speed, of which `index` is then shown.
    pub fn set_speed(&mut self, speed: Speed, count: usize, index: usize) {
        self.speed = speed;
        self.count = count;
        self.seek(index);
    }

    /// The number of frame times is another one: a sequence that grows.
    pub fn set_count(&mut self, count: usize) {
        self.count = count;
        self.index = self.index.min(count.saturating_sub(1));
    }

    /// The moment after the present one, none at the end of what is not looped.
    pub fn following(&self) -> Option<usize> {
        let stride = self.speed.stride();
        let last = self.count.checked_sub(1)?;
        match self.backwards {
            _ if last == 0 => None,
            false if self.index + stride <= last => Some(self.index + stride),
            false => self.looped.then_some(0),
            true if self.index >= stride => Some(self.index - stride),
            true => self.looped.then_some(last),
        }
    }

    /// Seconds that each moment is shown: a frame's time at every speed. Slow motion has more
    /// frame times, fast motion leaves frames out.
    pub fn duration(&self) -> f64 {
        self.fps.recip()
    }

    /// Time until the next moment is due.
    pub fn remaining(&self) -> Duration {
        Duration::from_secs_f64((self.duration() * (1.0 - self.phase)).clamp(0.001, 1.0))
    }

    /// Lets `seconds` pass. The next moment is gone to when its time has come and it is `there`;
    /// whether one was.
    pub fn advance(&mut self, seconds: f64, there: impl Fn(usize) -> bool) -> bool {
        if !self.playing {
            return false;
        }
        self.phase += seconds.clamp(0.0, 1.0) / self.duration();
        let from = self.index;
        while self.phase >= 1.0 {
            let Some(next) = self.following() else {
                self.playing = false;
                self.phase = 0.0;
                break;
            };
            if !there(next) {
                self.phase = 1.0;
                break;
            }
            self.index = next;
            self.phase -= 1.0;
        }
        self.index != from
    }
}
