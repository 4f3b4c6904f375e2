//! The times at which an input has frames, and whether their files exist.

use std::collections::BTreeMap;

use super::files;
use super::fluid::FluidSource;
use super::loader::Loader;
use crate::error::{Error, Result};
use crate::project::SolidMotion;
use crate::sequence::{Frame, FrameTime, Missing, is_absent};

impl Loader {
    /// Fails if a fluid or a solid lacks one of these frames and missing frames are errors.
    ///
    /// # Errors
    /// [`Error::MissingFrame`] naming the files and their first missing frame.
    pub fn check_frames(&self, numbers: &[i64]) -> Result<()> {
        let of_fluids = self.fluids.iter().map(|fluid| &fluid.sequence);
        for sequence in of_fluids.chain(self.motion().into_iter().flat_map(SolidMotion::sequences))
        {
            for &number in numbers {
                sequence.shown_or_missing(number, self.missing)?;
            }
        }
        Ok(())
    }

    /// Fails if a file of these frame times does not exist, as a piece that another lists or the target of a link, and
    /// missing frames are errors.
    ///
    /// # Errors
    /// [`Error::MissingFrames`] naming the list and the first of the files.
    pub fn check_files(&self, times: &[FrameTime]) -> Result<()> {
        if self.missing != Missing::Error {
            return Ok(());
        }
        let files = self.fluids.iter().filter(|fluid| matches!(fluid.source, FluidSource::Files));
        let of_fluids = files.map(|fluid| &fluid.sequence);
        for sequence in of_fluids.chain(self.motion().into_iter().flat_map(SolidMotion::sequences))
        {
            let numbers = times.iter().flat_map(|at| [at.frame, at.next]);
            let frames: BTreeMap<i64, &Frame> =
                numbers.filter_map(|number| Some((number, sequence.frame(number)?))).collect();
            let mut absent = Vec::new();
            for (number, frame) in frames {
                let files = std::iter::once(&frame.path).chain(&frame.parts);
                let files = files.flat_map(|path| files::with_pieces(path));
                absent.extend(files.filter(|path| is_absent(path)).map(|path| (number, path)));
            }
            if let Some((number, path)) = absent.first() {
                let more = match absent.len() - 1 {
                    0 => String::new(),
                    more => format!(", and {more} more files"),
                };
                let problem =
                    format!("the file {} of frame {number}{more} is missing", path.display());
                return Err(Error::MissingFrames { pattern: sequence.pattern.clone(), problem });
            }
        }
        Ok(())
    }

    /// Frame times at steps of `step` frames from the first of the ascending `numbers` to the last. A
    /// frame has the length of the sequence's [stride](crate::sequence::Sequence::stride).
    pub fn frame_times(&self, numbers: &[i64], step: f64) -> Vec<FrameTime> {
        let (Some(&first), Some(&last)) = (numbers.first(), numbers.last()) else {
            return Vec::new();
        };
        if step == 1.0 || step <= 0.0 || step.is_nan() {
            return numbers.iter().map(|&number| FrameTime::at(number)).collect();
        }
        let step = step * self.sequence.stride() as f64;
        let count = (last.abs_diff(first) as f64 / step * (1.0 + 1e-12)).floor() as usize;
        (0..=count).map(|k| FrameTime::after(numbers, k as f64 * step)).collect()
    }

    /// The frame time at `time`, in frames, among the ascending `numbers`: 12.25 is a quarter of the way
    /// from frame 12 to 13.
    ///
    /// # Errors
    /// [`Error::Sequence`] for a time before the first frame or after the last.
    pub fn frame_time(&self, numbers: &[i64], time: f64) -> Result<FrameTime> {
        let fail = |problem| Error::Sequence { pattern: self.sequence.pattern.clone(), problem };
        match numbers {
            [first, .., last] | [first @ last]
                if (*first as f64..=*last as f64).contains(&time) =>
            {
                Ok(FrameTime::after(numbers, time - *first as f64))
            }
            [first, .., last] => {
                Err(fail(format!("time {time} is not in its frames, from {first} to {last}")))
            }
            [frame] => Err(fail(format!("time {time} is not in its only frame, {frame}"))),
            [] => Err(fail("has no frames".into())),
        }
    }
}
