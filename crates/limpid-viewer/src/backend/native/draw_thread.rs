//! The draw thread, with its own [`limpid::offscreen::Offscreen`] renderer: the same code as in `limpid render`.
//!
//! The interface sends requests and never blocks. Pictures are drawn in many submissions, so that a newer request ends
//! one that takes long, between them.

use std::io::Write as _;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex};
use std::thread::JoinHandle;

use crate::backend::core::queue::{Artist, Job, Next, Queue};
use limpid::gpu::{Gpu, MOST_WORK};
use limpid::wgpu::DeviceType;
use limpid_io::error::Result;
use limpid_io::output::{self, FileKind};

pub use crate::backend::core::drawing::{Answer, Drawn, Measured, Pane, Request, Shown};

/// Largest work of one submission: so little that a few of them do not delay the next picture, on a card and on a
/// software adapter. A millisecond of each is lost.
const WORK: [u64; 2] = [MOST_WORK >> 4, MOST_WORK >> 8];

/// A handle to the thread, which ends when this is dropped.
#[derive(Debug)]
pub struct DrawThread {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug, Default)]
struct Shared {
    queue: Mutex<Queue>,
    changed: Condvar,
    /// Ends the picture that is being drawn early.
    interrupt: Arc<AtomicBool>,
}

impl DrawThread {
    /// Starts the thread, which calls `open` for a device at the first request and after each loss, and
    /// `answer` with each message.
    pub fn new(
        open: impl FnMut() -> Result<Gpu> + Send + 'static,
        answer: impl Fn(Answer) + Send + 'static,
    ) -> Self {
        let shared = Arc::new(Shared::default());
        let worker_shared = shared.clone();
        let thread = std::thread::spawn(move || {
            let (mut open, interrupt) = (open, worker_shared.interrupt.clone());
            let mut artist = Artist::new(
                async || {
                    let gpu = open()?;
                    let work =
                        WORK[usize::from(gpu.device.adapter_info().device_type == DeviceType::Cpu)];
                    Ok(gpu.with_most_work(work).with_interrupt(interrupt.clone()))
                },
                answer,
                |path, bytes| {
                    output::write_atomically(path, FileKind::PICTURE, |file| file.write_all(bytes))
                },
            );
            while let Some(next) = worker_shared.next() {
                // Nothing is awaited on a thread: what waits blocks.
                if let Some(job) = pollster::block_on(artist.act(next)) {
                    worker_shared.put_back(job);
                }
            }
        });
        Self { shared, thread: Some(thread) }
    }

    /// Requests pictures for the screen, in place of a request that has not begun.
    pub fn request(&self, request: Request) {
        self.change(|queue| queue.request(Some(request)));
    }

    /// Queues a task.
    pub(crate) fn job(&self, job: Job) {
        self.change(|queue| queue.push(job));
    }

    fn change(&self, change: impl FnOnce(&mut Queue)) {
        let mut queue = self.shared.queue.lock().expect("no thread panics with this lock");
        change(&mut queue);
        self.shared.interrupt.store(queue.interrupts(), Ordering::Relaxed);
        drop(queue);
        self.shared.changed.notify_one();
    }
}

impl Drop for DrawThread {
    /// Waits for the current picture, because a device must not be released while it draws, and for
    /// pictures to be saved.
    fn drop(&mut self) {
        self.change(Queue::close);
        if let Some(thread) = self.thread.take() {
            // The thread panics only if the device does, and then there is nothing to report.
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn put_back(&self, job: Job) {
        self.queue.lock().expect("no thread panics with this lock").put_back(job);
    }

    /// Waits for the next picture to draw; `None` once the queue is closed and empty.
    fn next(&self) -> Option<Next> {
        let mut queue = self.queue.lock().expect("no thread panics with this lock");
        loop {
            let next = queue.next();
            self.interrupt.store(false, Ordering::Relaxed);
            if next.is_some() || queue.is_closed() {
                return next;
            }
            queue = self.changed.wait(queue).expect("no thread panics with this lock");
        }
    }
}
