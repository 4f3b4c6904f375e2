//! Command recording that divides long work into several submissions.
//!
//! Many systems reset a GPU whose work takes longer than about two seconds, and other programs cannot use
//! it meanwhile. Passes that may take long therefore announce their work and record it in parts.

use std::collections::VecDeque;

use glam::UVec2;

use super::{Gpu, Span, TILE};

/// Largest work of one submission, in layer evaluations or equivalents. A slow GPU does this many per
/// second; an ordinary frame has fewer in total.
pub const MOST_WORK: u64 = 1 << 30;

/// Largest number of submissions in flight: more would only take memory.
const MAX_IN_FLIGHT: usize = 3;

/// The commands of a frame, recorded and submitted in parts, or recorded into a caller's encoder.
pub struct Commands<'a> {
    /// The device that the commands are for.
    pub gpu: &'a Gpu,
    /// Encoder of the next submission.
    pub encoder: &'a mut wgpu::CommandEncoder,
    /// Whether to submit parts.
    submits: bool,
    /// Work recorded in the encoder.
    work: u64,
    in_flight: VecDeque<wgpu::SubmissionIndex>,
    /// Number of submissions so far.
    pub submissions: u32,
}

impl<'a> Commands<'a> {
    /// Commands that are submitted in parts; after each part `encoder` is a new one.
    pub fn new(gpu: &'a Gpu, encoder: &'a mut wgpu::CommandEncoder) -> Self {
        let (in_flight, submissions) = (VecDeque::new(), 0);
        Self { gpu, encoder, submits: true, work: 0, in_flight, submissions }
    }

    /// Commands that the caller submits.
    pub fn within(gpu: &'a Gpu, encoder: &'a mut wgpu::CommandEncoder) -> Self {
        Self { submits: false, ..Self::new(gpu, encoder) }
    }

    /// Announces work. Submits the commands recorded so far if both together exceed one submission.
    pub fn reserve(&mut self, work: u64) {
        if self.work > 0 && self.work.saturating_add(work) > self.gpu.most_work {
            self.submit();
        }
        self.work = self.work.saturating_add(work);
    }

    /// Submits the recorded commands, unless the caller does.
    pub fn submit(&mut self) {
        if !self.submits {
            return;
        }
        let next = self.gpu.device.create_command_encoder(&Default::default());
        let commands = std::mem::replace(self.encoder, next).finish();
        if self.gpu.is_interrupted() {
            // The end of the frame reports it.
            return;
        }
        self.in_flight.push_back(self.gpu.queue.submit([commands]));
        self.work = 0;
        self.submissions += 1;
        if self.in_flight.len() > MAX_IN_FLIGHT {
            let submission_index = self.in_flight.pop_front();
            // A device loss is reported at the end of the frame. In a browser this returns at once.
            let _ = self.gpu.poll(wgpu::PollType::Wait { submission_index, timeout: None });
        }
    }

    /// The last submission, if there is one.
    pub fn last_submission(&self) -> Option<wgpu::SubmissionIndex> {
        self.in_flight.back().cloned()
    }

    /// Records `parts`, each with its work, in one compute pass, or in several passes and submissions if
    /// they exceed one submission.
    pub fn compute<T>(
        &mut self,
        label: &str,
        span: Span<'_>,
        parts: &[(T, u64)],
        mut record: impl FnMut(&mut wgpu::ComputePass<'_>, &T),
    ) {
        let mut rest = parts;
        while !rest.is_empty() {
            let mut work = 0u64;
            let fits = |(_, more): &&(T, u64)| {
                work = work.saturating_add(*more);
                work <= self.gpu.most_work
            };
            let count = rest.iter().take_while(fits).count().max(1);
            let (now, later) = rest.split_at(count);
            self.reserve(now.iter().fold(0, |sum: u64, (_, work)| sum.saturating_add(*work)));
            let mut pass = self.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(label),
                timestamp_writes: span.part(rest.len() == parts.len(), later.is_empty()).compute(),
            });
            now.iter().for_each(|(part, _)| record(&mut pass, part));
            rest = later;
        }
    }
}

/// A rectangle of a dispatch's threads.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece {
    /// The first thread along each axis.
    pub first: UVec2,
    /// Threads along each axis.
    pub size: UVec2,
}

/// Divides a dispatch of `extent` threads, each with `each` work, into pieces of at most `most` work, in
/// whole workgroups of 8 × 8: a single piece if it fits, and none smaller than a workgroup.
pub fn pieces(extent: UVec2, each: u64, most: u64) -> Vec<Piece> {
    let whole = |threads: u64, limit: u32| {
        let groups = (threads / u64::from(TILE)).clamp(1, u64::from(limit.div_ceil(TILE)));
        groups as u32 * TILE
    };
    let threads = most / each.max(1);
    let height = whole(threads / u64::from(extent.x.next_multiple_of(TILE)), extent.y);
    let width = whole(threads / u64::from(height), extent.x);
    let starts = |end: u32, step: u32| (0..end).step_by(step as usize);
    let piece =
        |first: UVec2| Piece { first, size: (extent - first).min(UVec2::new(width, height)) };
    starts(extent.y, height)
        .flat_map(|y| starts(extent.x, width).map(move |x| UVec2::new(x, y)))
        .map(piece)
        .collect()
}
