//! Who draws what: the frames that are left to this process.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use crate::fingerprint::{Fingerprint, Fingerprints};
use limpid_io::claim::{Claim, Claims};
use limpid_io::film::Take;
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
    pub(super) take: Take,
    pub(super) fingerprint: Fingerprint,
    /// Given up when the job is done.
    _claim: Option<Claim>,
}

/// The pictures that are not drawn yet.
pub(super) struct Queue {
    fingerprints: Fingerprints,
    claims: Option<(Claims, Pictures)>,
    pending: VecDeque<Take>,
    /// Claimed by others when they were last looked at.
    others: VecDeque<Take>,
}

/// What has become of a picture that was looked at.
enum Look {
    Mine(Box<Job>),
    Others,
    Done,
}

impl Queue {
    pub(super) fn new(
        takes: Vec<Take>,
        fingerprints: Fingerprints,
        claims: Option<(Claims, Pictures)>,
    ) -> Self {
        Self { fingerprints, claims, pending: takes.into(), others: VecDeque::new() }
    }

    /// Takes those out that need not be drawn again.
    pub(super) fn skip(&mut self, log: &mut Log) -> limpid_io::Result<()> {
        let Some(pictures) = log.pictures.clone() else { return Ok(()) };
        let takes = Vec::from(std::mem::take(&mut self.pending));
        // There may be so many that whoever interrupts would wait.
        let whole = |take: &Take| {
            signals::received().is_none() && pictures.are_whole(take, self.fingerprint(take))
        };
        let whole: Vec<bool> = takes.par_iter().map(whole).collect();
        for (take, whole) in takes.into_iter().zip(whole) {
            if !whole {
                self.pending.push_back(take);
                continue;
            }
            // One that was killed between its picture and its claim has left that behind.
            if let Some((claims, pictures)) = &self.claims
                && Claims::exist(&pictures.path(&take))
                && let Err(error) = claims.take(&pictures.path(&take))
            {
                // The picture is whole all the same.
                log.complain(format!("the claim on it is left: {error}"));
            }
            log.tell(&take, self.fingerprint(&take), Status::Skipped)?;
        }
        Ok(())
    }

    /// What has not been given out, in order, but for what others had when it was looked at.
    pub(super) fn pending(&mut self) -> &[Take] {
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
        self.pending.extend(job.map(|job| job.take));
    }

    /// The next one that is free; `None` if there is none, or a signal has come.
    pub(super) fn next_free(&mut self, log: &mut Log) -> limpid_io::Result<Option<Job>> {
        while signals::received().is_none()
            && let Some(take) = self.pending.pop_front()
        {
            match self.look(take) {
                Ok(Look::Mine(job)) => return Ok(Some(*job)),
                Ok(Look::Others) => self.others.push_back(take),
                Ok(Look::Done) => log.tell(&take, self.fingerprint(&take), Status::Claimed)?,
                Err(error) => log.fail(&take, self.fingerprint(&take), error)?,
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
                && let (Some((_, pictures)), Some(take)) = (&self.claims, self.others.front())
            {
                let holder = Claims::holder(&pictures.path(take));
                let (count, frame) = (self.others.len(), take.number);
                let frames = if count == 1 { "a frame" } else { &*format!("{count} frames") };
                log.complain(format!("waiting for {frames} of others: {frame} of {holder}"));
                silence *= 2;
            }
            std::thread::sleep(patience);
            patience = PATIENCE;
            self.pending = std::mem::take(&mut self.others);
        }
    }

    fn look(&self, take: Take) -> limpid_io::Result<Look> {
        let fingerprint = self.fingerprint(&take);
        let Some((claims, pictures)) = &self.claims else {
            return Ok(Look::Mine(Job { take, fingerprint, _claim: None }.into()));
        };
        if pictures.are_whole(&take, fingerprint) {
            return Ok(Look::Done);
        }
        let Some(claim) = claims.take(&pictures.path(&take))? else { return Ok(Look::Others) };
        // The owner before may have finished since.
        if pictures.are_whole(&take, fingerprint) {
            return Ok(Look::Done);
        }
        Ok(Look::Mine(Job { take, fingerprint, _claim: Some(claim) }.into()))
    }

    fn fingerprint(&self, take: &Take) -> Fingerprint {
        self.fingerprints.of(take.frame, &take.camera)
    }
}
