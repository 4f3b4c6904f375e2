//! Times in a sequence: at its frames and between them.

use super::Frame;
use serde::{Deserialize, Serialize};

/// A time in a sequence: a frame, or a time between two frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FrameTime {
    /// The frame, or the previous one.
    pub frame: i64,
    /// The next frame; at a frame, the same.
    pub next: i64,
    /// Fraction of the interval between them: 0 at a frame, always below 1.
    pub fraction: f64,
}

impl FrameTime {
    /// The time of a frame.
    pub fn at(frame: i64) -> Self {
        Self { frame, next: frame, fraction: 0.0 }
    }

    /// The time in frames: 12.25 is a quarter of the way from frame 12 to 13.
    pub fn time(self) -> f64 {
        self.frame as f64 + self.fraction * self.next.abs_diff(self.frame) as f64
    }

    /// The frame time at `time` after the first of the ascending `numbers`; beyond the last, the last.
    pub fn after(numbers: &[i64], time: f64) -> Self {
        let Some(&first) = numbers.first() else { return Self::at(0) };
        // Relative to the first frame, so that large numbers lose no digits.
        let since = |number: i64| number.abs_diff(first) as f64;
        // A rounding error must not miss a frame's own time.
        let near = time.round();
        let time = if (time - near).abs() < 1e-9 * near.abs().max(1.0) { near } else { time };
        let after = numbers.partition_point(|&number| since(number) <= time);
        let frame = numbers.get(after.saturating_sub(1)).copied().unwrap_or(first);
        match numbers.get(after) {
            Some(&next) if time > since(frame) => {
                let fraction = (time - since(frame)) / (since(next) - since(frame));
                Self { frame, next, fraction }
            }
            _ => Self::at(frame),
        }
    }
}

impl From<&Frame> for FrameTime {
    fn from(frame: &Frame) -> Self {
        Self::at(frame.number)
    }
}
