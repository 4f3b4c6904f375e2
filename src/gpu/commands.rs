//! A frame's commands, in as many submissions as their work asks for.
//!
//! Many systems reset a graphics card whose work takes longer than two seconds or so, and nobody else gets a
//! turn until it ends. So passes that may take long tell how much they have to do, and do it in parts.

use std::collections::VecDeque;

use glam::UVec2;

use super::{Gpu, Span, TILE};

/// Most work of one submission: evaluations of a layer, or what takes as long. Slow graphics cards do as
/// many in a second; ordinary frames have less in all.
pub const MOST_WORK: u64 = 1 << 30;

/// Submissions that may wait for the device: more would only take memory.
const WAITING: usize = 3;

/// Commands on their way to the device.
pub struct Commands<'a> {
    /// The device that gets the commands.
    pub gpu: &'a Gpu,
    /// Takes what is recorded next.
    pub encoder: wgpu::CommandEncoder,
    /// That the encoder holds.
    work: u64,
    waiting: VecDeque<wgpu::SubmissionIndex>,
    /// How often commands have gone to the device.
    pub submissions: u32,
}

impl<'a> Commands<'a> {
    /// Nothing recorded yet.
    pub fn new(gpu: &'a Gpu) -> Self {
        let encoder = gpu.device.create_command_encoder(&Default::default());
        Self { gpu, encoder, work: 0, waiting: VecDeque::new(), submissions: 0 }
    }

    /// Announces work. What was recorded before goes to the device if it is too much for one submission
    /// together.
    pub fn reserve(&mut self, work: u64) {
        if self.work > 0 && self.work.saturating_add(work) > self.gpu.most_work {
            self.submit();
        }
        self.work = self.work.saturating_add(work);
    }

    /// Gives the device what was recorded.
    pub fn submit(&mut self) {
        let next = self.gpu.device.create_command_encoder(&Default::default());
        let commands = std::mem::replace(&mut self.encoder, next).finish();
        self.waiting.push_back(self.gpu.queue.submit([commands]));
        self.work = 0;
        self.submissions += 1;
        if self.waiting.len() > WAITING {
            let submission_index = self.waiting.pop_front();
            // A device that is lost meanwhile tells so when the frame ends.
            let _ = self.gpu.poll(wgpu::PollType::Wait { submission_index, timeout: None });
        }
    }

    /// Records `parts` with their work in one compute pass, or in several of as many submissions as it takes.
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

/// A rectangle of a dispatch's threads, in whole workgroups.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Piece {
    /// The first thread along each axis.
    pub first: UVec2,
    /// Threads along each axis.
    pub size: UVec2,
}

/// Divides a dispatch of `extent` threads in workgroups of 8 × 8, each of which does `each` work, into
/// pieces of at most `most`: one, if it fits, and none less than a workgroup.
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
