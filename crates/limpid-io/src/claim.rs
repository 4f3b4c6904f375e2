//! Frames that a process sets aside for itself in a folder that several share, without a server.
//!
//! A claim is a file beside the picture, `frame_0012.png.claim1`, that only one process can create
//! (`O_EXCL`, which NFS has kept to since version 3). While its owner lives it is written to again
//! and again; one that has not been written to for a while is stale, and its frame is taken over.
//!
//! Ages are differences of times that the file server gave, since clocks of machines differ: when a
//! claim was last written to, and when a file of one's own is written to now. A claim from the future
//! (the server's clock was set back) is stale once it has not changed for as long as it is watched.
//!
//! To take over the stale claim `n` is to create claim `n + 1`, which again only one can; the last
//! claim holds. Were it removed or renamed instead, a process that has found it stale a moment ago
//! would remove what another has put in its place.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, ErrorKind, Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant, SystemTime};

use crate::error::{Error, Result, printable};
use crate::output::{self, CleanupGuard};

/// How often a claim is written to before it would be stale.
const BEATS: u32 = 6;

/// How a process claims frames.
#[derive(Debug)]
pub struct Claims {
    owner: String,
    timeout: Duration,
    /// Claims from the future: when they were last written to, and since when that is known.
    ahead: Mutex<HashMap<PathBuf, (SystemTime, Instant)>>,
}

/// A frame that is this process's to draw, until this is dropped.
#[derive(Debug)]
pub struct Claim {
    picture: PathBuf,
    /// Which claim on the frame this is, from 1; those before it are stale.
    number: u32,
    // In this order: nobody writes to it, then it is removed, then forgotten.
    heart: Option<Heart>,
    _litter: CleanupGuard,
}

impl Claims {
    /// Claims that say who their `owner` is, for people to read, and are stale at an age of `timeout`.
    pub fn new(owner: String, timeout: Duration) -> Self {
        Self { owner, timeout, ahead: Mutex::default() }
    }

    /// The age at which a claim is stale.
    pub fn timeout(&self) -> Duration {
        self.timeout
    }

    /// Claims the frame whose picture is to be `picture`; `None` if it is another's.
    ///
    /// The owner before may have written the picture: look again.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder cannot be written to, or what is there by a claim's name is none: a
    /// link, a folder, a pipe.
    pub fn take(&self, picture: &Path) -> Result<Option<Claim>> {
        let mut stale: Option<(PathBuf, SystemTime)> = None;
        for number in 1.. {
            let path = file(picture, number);
            let fail = |e: io::Error| Error::io(&path, "claim", e);
            match CleanupGuard::create(|| Ok((File::create_new(&path)?, path.clone()))) {
                Ok((file, cleanup)) => {
                    // Had the stale claim been given up meanwhile, another may hold the first one.
                    let given_up = |(path, time): &(PathBuf, SystemTime)| {
                        written(path).ok().as_ref() != Some(time)
                    };
                    if stale.as_ref().is_some_and(given_up) {
                        std::fs::remove_file(&path).map_err(fail)?;
                        return Ok(None);
                    }
                    let picture = picture.to_owned();
                    let mut claim = Claim { picture, number, heart: None, _litter: cleanup };
                    beat(&file, &self.owner).map_err(fail)?;
                    let heart = Heart::start(file, self.owner.clone(), self.timeout / BEATS);
                    claim.heart = Some(heart.map_err(Error::Threads)?);
                    return Ok(Some(claim));
                }
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                Err(e) => return Err(fail(e)),
            }
            // This first: if this process sleeps in between, nobody looks dead.
            let now = output::file_time(picture)?;
            let time = match written(&path) {
                Ok(time) => time,
                // Given up meanwhile.
                Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
                Err(e) => return Err(fail(e)),
            };
            if !self.is_stale(&path, time, now) {
                return Ok(None);
            }
            stale = Some((path, time));
        }
        Ok(None)
    }

    /// Whether a claim that was last written to at `time` is nobody's any more.
    fn is_stale(&self, claim: &Path, time: SystemTime, now: SystemTime) -> bool {
        if let Ok(age) = now.duration_since(time) {
            return age > self.timeout;
        }
        let mut ahead = self.ahead.lock().unwrap_or_else(PoisonError::into_inner);
        let known = ahead.entry(claim.to_owned()).or_insert_with(|| (time, Instant::now()));
        if known.0 != time {
            *known = (time, Instant::now());
        }
        known.1.elapsed() > self.timeout
    }

    /// Who has claimed a frame, in that process's own words, and in which file.
    pub fn holder(picture: &Path) -> String {
        const MOST: u64 = 200;
        let there = |path: &PathBuf| path.symlink_metadata().is_ok();
        let claims = (1..).map(|number| file(picture, number)).take_while(there);
        let Some(path) = claims.last() else { return "nobody any more".into() };
        let mut owner = Vec::new();
        let read = File::open(&path).and_then(|file| file.take(MOST).read_to_end(&mut owner));
        let owner = match read {
            Ok(_) => printable(String::from_utf8_lossy(owner.trim_ascii()).into_owned()),
            Err(error) => format!("another user ({error})"),
        };
        format!("{owner}: {}", path.display())
    }

    /// Whether there is a claim on it, stale or not.
    pub fn exist(picture: &Path) -> bool {
        file(picture, 1).exists()
    }
}

impl Drop for Claim {
    /// Gives the frame up.
    fn drop(&mut self) {
        self.heart = None;
        // Who has taken the frame over, since this process was thought dead, removes all.
        if file(&self.picture, self.number + 1).exists() {
            return;
        }
        // The first one first: whoever creates it anew holds the frame.
        for number in 1..=self.number {
            // What cannot be removed is stale soon.
            let _ = std::fs::remove_file(file(&self.picture, number));
        }
    }
}

/// `frame_0012.png.claim1`.
fn file(picture: &Path, number: u32) -> PathBuf {
    let mut name = picture.as_os_str().to_owned();
    name.push(format!(".claim{number}"));
    name.into()
}

/// When a claim was last written to.
fn written(claim: &Path) -> io::Result<SystemTime> {
    let metadata = claim.symlink_metadata()?;
    if !metadata.is_file() {
        let problem = "this is a link, a folder or a pipe, not a claim; remove it";
        return Err(io::Error::other(problem));
    }
    // NFS asks the server when a file is opened; another user's may be closed to this one.
    match File::open(claim) {
        Ok(file) => file.metadata()?.modified(),
        Err(e) if e.kind() == ErrorKind::PermissionDenied => metadata.modified(),
        Err(e) => Err(e),
    }
}

/// Writes a claim anew, so that it is young.
fn beat(mut file: &File, owner: &str) -> io::Result<()> {
    file.rewind()?;
    file.write_all(owner.as_bytes())?;
    file.sync_all()
}

/// Writes to a claim again and again, until it is dropped.
#[derive(Debug)]
struct Heart {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Heart {
    fn start(file: File, owner: String, every: Duration) -> io::Result<Self> {
        let (stop, stopped) = mpsc::channel();
        let thread = Builder::new().spawn(move || {
            while stopped.recv_timeout(every) == Err(RecvTimeoutError::Timeout) {
                // At worst the frame is taken over and drawn twice, to the same picture.
                let _ = beat(&file, &owner);
            }
        })?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for Heart {
    /// Waits until the file is closed.
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            // It has nothing to tell.
            let _ = thread.join();
        }
    }
}
