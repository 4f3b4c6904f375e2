//! The queue of pictures to draw, shared with other processes by claims.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use crate::fingerprint::{Fingerprint, Fingerprints};
use limpid_io::claim::{Claim, Claims};
use limpid_io::film::Shot;
use rayon::prelude::*;

use super::manifest::{Log, Status};
use super::pictures::Pictures;
use crate::signals;

/// Interval at which the pictures claimed by other processes are checked.
const POLL_INTERVAL: Duration = Duration::from_millis(500);

/// Time until a wait for other processes is reported; each further report takes twice as long.
const REPORT_DELAY: Duration = Duration::from_secs(30);

/// A picture to be drawn by this process.
pub(super) struct Job {
    pub(super) shot: Shot,
    pub(super) fingerprint: Fingerprint,
    /// Released with the job.
    _claim: Option<Claim>,
}

/// The pictures not drawn yet.
pub(super) struct Queue {
    fingerprints: Fingerprints,
    claims: Option<(Claims, Pictures)>,
    pending: VecDeque<Shot>,
    /// Claimed by other processes when last checked.
    others: VecDeque<Shot>,
}

/// The state of a picture when checked.
enum Availability {
    Free(Box<Job>),
    Claimed,
    Done,
}

impl Queue {
    pub(super) fn new(
        shots: Vec<Shot>,
        fingerprints: Fingerprints,
        claims: Option<(Claims, Pictures)>,
    ) -> Self {
        Self { fingerprints, claims, pending: shots.into(), others: VecDeque::new() }
    }

    /// Removes the pictures that need not be drawn again.
    pub(super) fn skip(&mut self, log: &mut Log) -> limpid_io::Result<()> {
        let Some(pictures) = log.pictures.clone() else { return Ok(()) };
        let shots = Vec::from(std::mem::take(&mut self.pending));
        // An interruption skips the check, which may take long for many pictures.
        let whole = |shot: &Shot| {
            signals::received().is_none() && pictures.are_whole(shot, self.fingerprint(shot))
        };
        let whole: Vec<bool> = shots.par_iter().map(whole).collect();
        for (shot, whole) in shots.into_iter().zip(whole) {
            if !whole {
                self.pending.push_back(shot);
                continue;
            }
            // Remove the claim of a process that was killed after writing the picture.
            if let Some((claims, pictures)) = &self.claims
                && Claims::exist(&pictures.path(&shot))
                && let Err(error) = claims.take(&pictures.path(&shot))
            {
                // Not fatal: the picture is complete.
                log.warn(format!("the claim on it is left: {error}"));
            }
            log.record(&shot, self.fingerprint(&shot), Status::Skipped)?;
        }
        Ok(())
    }

    /// The remaining pictures in order, without those that other processes had claimed when checked.
    pub(super) fn pending(&mut self) -> &[Shot] {
        self.pending.make_contiguous()
    }

    /// Number of pictures left, including those claimed by other processes.
    pub(super) fn len(&self) -> usize {
        self.pending.len() + self.others.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns a picture to the queue, and releases its claim.
    pub(super) fn give_back(&mut self, job: Option<Job>) {
        self.pending.extend(job.map(|job| job.shot));
    }

    /// Takes the next free picture; `None` if there is none, or after a signal.
    pub(super) fn next_free(&mut self, log: &mut Log) -> limpid_io::Result<Option<Job>> {
        while signals::received().is_none()
            && let Some(shot) = self.pending.pop_front()
        {
            match self.availability(shot) {
                Ok(Availability::Free(job)) => return Ok(Some(*job)),
                Ok(Availability::Claimed) => self.others.push_back(shot),
                Ok(Availability::Done) => {
                    log.record(&shot, self.fingerprint(&shot), Status::Claimed)?;
                }
                Err(error) => log.fail(&shot, self.fingerprint(&shot), error)?,
            }
        }
        Ok(None)
    }

    /// As [`Queue::next_free`], but waits until other processes have drawn or released their pictures.
    pub(super) fn next(&mut self, log: &mut Log) -> limpid_io::Result<Option<Job>> {
        let mut interval = Duration::ZERO;
        let since = Instant::now();
        let timeout = self.claims.as_ref().map_or(REPORT_DELAY, |(claims, _)| claims.timeout());
        let mut report_delay = timeout.min(REPORT_DELAY);
        loop {
            let job = self.next_free(log)?;
            if job.is_some() || self.others.is_empty() || signals::received().is_some() {
                return Ok(job);
            }
            if since.elapsed() >= report_delay
                && let (Some((_, pictures)), Some(shot)) = (&self.claims, self.others.front())
            {
                let holder = Claims::holder(&pictures.path(shot));
                let (count, frame) = (self.others.len(), shot.number);
                let frames = if count == 1 { "a frame" } else { &*format!("{count} frames") };
                log.warn(format!("waiting for {frames} of others: {frame} of {holder}"));
                report_delay *= 2;
            }
            std::thread::sleep(interval);
            interval = POLL_INTERVAL;
            self.pending = std::mem::take(&mut self.others);
        }
    }

    /// Checks a picture, and claims it if it is free.
    fn availability(&self, shot: Shot) -> limpid_io::Result<Availability> {
        let fingerprint = self.fingerprint(&shot);
        let Some((claims, pictures)) = &self.claims else {
            return Ok(Availability::Free(Job { shot, fingerprint, _claim: None }.into()));
        };
        if pictures.are_whole(&shot, fingerprint) {
            return Ok(Availability::Done);
        }
        let Some(claim) = claims.take(&pictures.path(&shot))? else {
            return Ok(Availability::Claimed);
        };
        // The previous owner may have finished the picture meanwhile.
        if pictures.are_whole(&shot, fingerprint) {
            return Ok(Availability::Done);
        }
        Ok(Availability::Free(Job { shot, fingerprint, _claim: Some(claim) }.into()))
    }

    fn fingerprint(&self, shot: &Shot) -> Fingerprint {
        self.fingerprints.of(shot)
    }
}
