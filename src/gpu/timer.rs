//! Pass times from device timestamps.

use serde::Serialize;

use super::{Gpu, Pending};
use crate::error::Result;

/// Device time of one pass.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PassTime {
    /// Name of the pass, which is also that of its file, settings and shader.
    pub name: &'static str,
    /// Duration in milliseconds.
    pub ms: f64,
}

/// Timestamp queries, two per span. A pass that consists of several device passes is one span, from the
/// beginning of the first to the end of the last.
#[derive(Debug)]
pub struct Timer {
    queries: Option<wgpu::QuerySet>,
    names: Vec<&'static str>,
    most: usize,
}

/// Timestamps for a device pass: at its beginning, at its end, or both.
#[derive(Debug, Clone, Copy, Default)]
pub struct Span<'a> {
    queries: Option<&'a wgpu::QuerySet>,
    begin: Option<u32>,
    end: Option<u32>,
}

impl Timer {
    /// Creates a timer of `most` spans, which measures only if `enabled` and if the device supports timestamps.
    pub fn new(gpu: &Gpu, enabled: bool, most: usize) -> Self {
        let enabled = enabled && gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let most = most.min(wgpu::QUERY_SET_MAX_QUERIES as usize / 2);
        let queries = enabled.then(|| {
            gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("pass times"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * most as u32,
            })
        });
        Self { queries, names: Vec::new(), most }
    }

    /// Starts a span of one device pass or, with [`Span::first`] and [`Span::last`], of several. Spans beyond the
    /// timer's number are not measured.
    pub fn span(&mut self, name: &'static str) -> Span<'_> {
        if self.names.len() >= self.most {
            return Span::default();
        }
        let index = 2 * self.names.len() as u32;
        self.names.push(name);
        Span { queries: self.queries.as_ref(), begin: Some(index), end: Some(index + 1) }
    }

    /// Records the resolution of all timestamps into a buffer for `Timer::read`.
    pub fn resolve(&self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> Option<wgpu::Buffer> {
        let queries = self.queries.as_ref()?;
        let count = 2 * self.names.len() as u32;
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("pass times"),
            size: u64::from(count.max(1)) * 8,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        encoder.resolve_query_set(queries, 0..count, &buffer, 0);
        Some(buffer)
    }

    /// Waits for the device and returns the spans in order; empty without timestamps.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn read(&self, gpu: &Gpu, resolved: Option<&wgpu::Buffer>) -> Result<Vec<PassTime>> {
        let Some(buffer) = resolved else { return Ok(Vec::new()) };
        Ok(self.times(gpu, &gpu.read_buffer(buffer)?))
    }

    /// The spans' times, from the bytes of a resolved buffer.
    fn times(&self, gpu: &Gpu, bytes: &[u8]) -> Vec<PassTime> {
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(bytes);
        let ms_per_tick = f64::from(gpu.queue.get_timestamp_period()) * 1e-6;
        self.names
            .iter()
            .zip(ticks.chunks_exact(2))
            .map(|(&name, t)| PassTime { name, ms: t[1].saturating_sub(t[0]) as f64 * ms_per_tick })
            .collect()
    }
}

/// Pass times of commands that the caller submits, collected without waiting.
#[derive(Debug)]
pub struct PendingTimes {
    timer: Timer,
    ticks: Pending,
}

impl PendingTimes {
    /// Records the copy of the times; `None` without timestamps.
    pub fn record(gpu: &Gpu, timer: Timer, encoder: &mut wgpu::CommandEncoder) -> Option<Self> {
        let resolved = timer.resolve(gpu, encoder)?;
        let ticks = Pending::record(gpu, encoder, &resolved, 0, resolved.size());
        Some(Self { timer, ticks })
    }

    /// The times of commands that have been submitted.
    pub fn submitted(self, submission: wgpu::SubmissionIndex) -> SubmittedTimes {
        SubmittedTimes { times: self, submission }
    }

    /// The times, if the device has finished: see [`Pending::collect`].
    pub fn collect(&mut self, gpu: &Gpu) -> Option<Vec<PassTime>> {
        Some(self.timer.times(gpu, &self.ticks.collect()?))
    }
}

/// Pass times of a submission.
#[derive(Debug)]
pub struct SubmittedTimes {
    times: PendingTimes,
    submission: wgpu::SubmissionIndex,
}

impl SubmittedTimes {
    /// Waits for the submission: in a browser by yielding, elsewhere by blocking.
    ///
    /// # Errors
    /// [`crate::Error::DeviceLost`].
    pub async fn finish(self, gpu: &Gpu) -> Result<Vec<PassTime>> {
        let PendingTimes { timer, ticks } = self.times;
        Ok(timer.times(gpu, &ticks.finish(gpu, self.submission).await?))
    }
}

impl<'a> Span<'a> {
    /// Keeps only the beginning, for the first of several device passes.
    pub fn first(self) -> Self {
        Self { end: None, ..self }
    }

    /// Keeps only the end, for the last of several device passes.
    pub fn last(self) -> Self {
        Self { begin: None, ..self }
    }

    /// Keeps the beginning if `first` and the end if `last`, for one of several device passes.
    pub fn part(self, first: bool, last: bool) -> Self {
        Self { begin: self.begin.filter(|_| first), end: self.end.filter(|_| last), ..self }
    }

    /// Timestamp writes for a render pass.
    pub fn render(self) -> Option<wgpu::RenderPassTimestampWrites<'a>> {
        (self.begin.is_some() || self.end.is_some()).then_some(wgpu::RenderPassTimestampWrites {
            query_set: self.queries?,
            beginning_of_pass_write_index: self.begin,
            end_of_pass_write_index: self.end,
        })
    }

    /// Timestamp writes for a compute pass.
    pub fn compute(self) -> Option<wgpu::ComputePassTimestampWrites<'a>> {
        (self.begin.is_some() || self.end.is_some()).then_some(wgpu::ComputePassTimestampWrites {
            query_set: self.queries?,
            beginning_of_pass_write_index: self.begin,
            end_of_pass_write_index: self.end,
        })
    }
}
