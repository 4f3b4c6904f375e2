//! Playback: the frame time of a sequence that is shown, and when the next one is due.

use std::time::Duration;

/// Playback of `count` frame times.
///
/// It shows every frame time in order and waits for those that are not loaded yet, so a slow machine
/// plays slowly and skips nothing. At speeds above 1 it advances several frames at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Playback {
    /// Whether playback is running.
    pub playing: bool,
    /// Whether it runs towards the first frame time.
    pub backwards: bool,
    /// Whether it continues at the other end.
    pub looped: bool,
    /// Frames of the sequence per second at speed 1.
    pub fps: f64,
    speed: Speed,
    index: usize,
    count: usize,
    /// Elapsed share of the current frame time's duration, up to 1.
    phase: f64,
    /// The first and the last frame time that are played, if not all are.
    marked: Option<[usize; 2]>,
}

/// Speed of playback.
///
/// Slow motion, below 1, interpolates frame times between the frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Speed {
    /// One eighth.
    Eighth,
    /// One quarter.
    Quarter,
    /// One half.
    Half,
    /// The speed of the simulation.
    #[default]
    Real,
    /// Every second frame.
    Double,
    /// Every fourth frame.
    Quadruple,
}

impl Speed {
    /// All speeds, slowest first.
    pub const ALL: [Self; 6] =
        [Self::Eighth, Self::Quarter, Self::Half, Self::Real, Self::Double, Self::Quadruple];

    /// Frames of the sequence from one frame time to the next: 1, or less in slow motion.
    pub fn step(self) -> f64 {
        match self {
            Self::Eighth => 0.125,
            Self::Quarter => 0.25,
            Self::Half => 0.5,
            Self::Real | Self::Double | Self::Quadruple => 1.0,
        }
    }

    /// Frame times that playback advances at a time.
    pub fn stride(self) -> usize {
        match self {
            Self::Double => 2,
            Self::Quadruple => 4,
            _ => 1,
        }
    }

    /// Display name.
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

    /// The next or previous speed in [`Speed::ALL`], clamped to its ends.
    #[must_use]
    pub fn next(self, faster: bool) -> Self {
        let at = Self::ALL.iter().position(|&speed| speed == self).unwrap_or_default();
        let to = if faster { at + 1 } else { at.saturating_sub(1) };
        Self::ALL[to.min(Self::ALL.len() - 1)]
    }
}

impl Playback {
    /// Creates playback paused at the first of `count` frame times, for `fps` frames per second.
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
            marked: None,
        }
    }

    /// Index of the frame time shown.
    pub fn index(&self) -> usize {
        self.index
    }

    /// Number of frame times.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The first and the last frame time that are played.
    pub fn span(&self) -> [usize; 2] {
        self.marked.unwrap_or([0, self.count.saturating_sub(1)])
    }

    /// As [`Playback::span`], if not all are played.
    pub fn marked(&self) -> Option<[usize; 2]> {
        self.marked
    }

    /// Sets the first and the last frame time that are played, or plays all.
    pub fn mark(&mut self, marked: Option<[usize; 2]>) {
        let end = self.count.saturating_sub(1);
        let clamped = marked.map(|ends| ends.map(|i| i.min(end)));
        self.marked = clamped.filter(|ends| ends[0] < ends[1] && *ends != [0, end]);
    }

    /// Begins playback at the current frame time, or if it does, at the first one.
    pub fn mark_first(&mut self) {
        let ([first, last], end) = (self.span(), self.count.saturating_sub(1));
        let begin = if first == self.index { 0 } else { self.index };
        self.mark(Some([begin, if last > begin { last } else { end }]));
    }

    /// Ends playback at the current frame time, or if it does, at the last one.
    pub fn mark_last(&mut self) {
        let ([first, last], end) = (self.span(), self.count.saturating_sub(1));
        let stop = if last == self.index { end } else { self.index };
        self.mark(Some([if first < stop { first } else { 0 }, stop]));
    }

    /// Speed of playback.
    pub fn speed(&self) -> Speed {
        self.speed
    }

    /// Signed step between successive frame times, for the frame caches.
    pub fn step(&self) -> isize {
        let stride = self.speed.stride() as isize;
        if self.backwards { -stride } else { stride }
    }

    /// Goes to a frame time, at most the last.
    pub fn seek(&mut self, index: usize) {
        self.index = index.min(self.count.saturating_sub(1));
        self.phase = 0.0;
    }

    /// Goes forwards or backwards by one frame time, and pauses.
    pub fn step_by(&mut self, forwards: bool) {
        self.playing = false;
        let to = match forwards {
            true => (self.index + 1).checked_rem(self.count),
            false => self.index.checked_sub(1).or(self.count.checked_sub(1)),
        };
        self.seek(to.unwrap_or(0));
    }

    /// Replaces the frame times by those of another speed, and shows `index`.
    pub fn set_speed(&mut self, speed: Speed, count: usize, index: usize) {
        self.speed = speed;
        self.count = count;
        self.seek(index);
    }

    /// Changes the number of frame times, for a growing sequence.
    pub fn set_count(&mut self, count: usize) {
        self.count = count;
        self.mark(self.marked);
        self.index = self.index.min(count.saturating_sub(1));
    }

    /// The frame time after the current one; `None` at the end unless looped.
    pub fn following(&self) -> Option<usize> {
        let stride = self.speed.stride();
        let [first, last] = self.span();
        match self.backwards {
            _ if last == first => None,
            false if self.index < first => Some(first),
            false if self.index + stride <= last => Some(self.index + stride),
            false => self.looped.then_some(first),
            true if self.index > last => Some(last),
            true if self.index >= first + stride => Some(self.index - stride),
            true => self.looped.then_some(last),
        }
    }

    /// Seconds that each frame time is shown: the duration of a frame at every speed, because slow motion
    /// has more frame times and fast motion skips frames.
    pub fn duration(&self) -> f64 {
        self.fps.recip()
    }

    /// Time until the next frame time is due.
    pub fn remaining(&self) -> Duration {
        Duration::from_secs_f64((self.duration() * (1.0 - self.phase)).clamp(0.001, 1.0))
    }

    /// Advances by `seconds`, to the next frame time once it is due and loaded. Returns whether the frame
    /// time changed.
    pub fn advance(&mut self, seconds: f64, mut is_loaded: impl FnMut(usize) -> bool) -> bool {
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
            if !is_loaded(next) {
                self.phase = 1.0;
                break;
            }
            self.index = next;
            self.phase -= 1.0;
        }
        self.index != from
    }
}
