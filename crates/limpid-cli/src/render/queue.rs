//! Who draws what: the frames that are left to this process.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use crate::fingerprint::{Fingerprint, Fingerprints};
use limpid_io::claim::{Claim, Claims};
use limpid_io::film::Shot;
use rayon::prelude::*;

use super::manifest::{Log, Status};
use super::output::Pictures;
use crate::signals;

/// How often it is looked whether others have finished their frames.
const PATIENCE: Duration = Duration::from_millis(500);

/// After how long it is said that others are waited for; then after twice as long, and so on.
const SILENCE: Duration = Duration::from_secs(30);

/// A picture that is this process's to draw.
pub(super) struct Job {
    pub(super) shot: Shot,
    pub(super) fingerprint: Fingerprint,
    /// Given up when the job is done.
    _claim: Option<Claim>,
}

/// The pictures that are not drawn yet.
pub(super) struct Queue {
    fingerprints: Fingerprints,
    claims: Option<(Claims, Pictures)>,
    pending: VecDeque<Shot>,
    /// Claimed by others when they were last looked at.
    others: VecDeque<Shot>,
}

/// What has become of a picture that was looked at.
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

    /// Takes those out that need not be drawn again.
    pub(super) fn skip(&mut self, log: &mut Log) -> limpid_io::Result<()> {
        let Some(pictures) = log.pictures.clone() else { return Ok(()) };
        let shots = Vec::from(std::mem::take(&mut self.pending));
        // There may be so many that whoever interrupts would wait.
        let whole = |shot: &Shot| {
            signals::received().is_none() && pictures.are_whole(shot, self.fingerprint(shot))
        };
        let whole: Vec<bool> = shots.par_iter().map(whole).collect();
        for (shot, whole) in shots.into_iter().zip(whole) {
            if !whole {
                self.pending.push_back(shot);
                continue;
            }
            // One that was killed between its picture and its claim has left that behind.
            if let Some((claims, pictures)) = &self.claims
                && Claims::exist(&pictures.path(&shot))
                && let Err(error) = claims.take(&pictures.path(&shot))
            {
                // The picture is whole all the same.
                log.complain(format!("the claim on it is left: {error}"));
            }
            log.tell(&shot, self.fingerprint(&shot), Status::Skipped)?;
        }
        Ok(())
    }

    /// What has not been given out, in order, but for what others had when it was looked at.
    pub(super) fn pending(&mut self) -> &[Shot] {
        self.pending.make_contiguous()
    }

    /// How many are left, those of others included.
    pub(super) fn len(&self) -> usize {
        self.pending.len() + self.others.len()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Gives up what is not going to be drawn.
    pub(super) fn give_back(&mut self, job: Option<Job>) {
        self.pending.extend(job.map(|job| job.shot));
    }

    /// The next one that is free; `None` if there is none, or a signal has come.
    pub(super) fn next_free(&mut self, log: &mut Log) -> limpid_io::Result<Option<Job>> {
        while signals::received().is_none()
            && let Some(shot) = self.pending.pop_front()
        {
            match self.availability(shot) {
                Ok(Availability::Free(job)) => return Ok(Some(*job)),
                Ok(Availability::Claimed) => self.others.push_back(shot),
                Ok(Availability::Done) => {
                    log.tell(&shot, self.fingerprint(&shot), Status::Claimed)?;
                }
                Err(error) => log.fail(&shot, self.fingerprint(&shot), error)?,
            }
        }
        Ok(None)
    }

    /// As [`Queue::next_free`], but waits until others have drawn theirs, or given them up.
    pub(super) fn next(&mut self, log: &mut Log) -> limpid_io::Result<Option<Job>> {
        let mut patience = Duration::ZERO;
        let since = Instant::now();
        let mut silence = self.claims.as_ref().map_or(SILENCE, |(c, _)| c.timeout().min(SILENCE));
        loop {
            let job = self.next_free(log)?;
            if job.is_some() || self.others.is_empty() || signals::received().is_some() {
                return Ok(job);
            }
            if since.elapsed() >= silence
                && let (Some((_, pictures)), Some(shot)) = (&self.claims, self.others.front())
            {
                let holder = Claims::holder(&pictures.path(shot));
                let (count, frame) = (self.others.len(), shot.number);
                let frames = if count == 1 { "a frame" } else { &*format!("{count} frames") };
                log.complain(format!("waiting for {frames} of others: {frame} of {holder}"));
                silence *= 2;
            }
            std::thread::sleep(patience);
            patience = PATIENCE;
            self.pending = std::mem::take(&mut self.others);
        }
    }

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
        // The owner before may have finished since.
        if pictures.are_whole(&shot, fingerprint) {
            return Ok(Availability::Done);
        }
        Ok(Availability::Free(Job { shot, fingerprint, _claim: Some(claim) }.into()))
    }

    fn fingerprint(&self, shot: &Shot) -> Fingerprint {
        self.fingerprints.of(shot.frame, &shot.camera)
    }
}
