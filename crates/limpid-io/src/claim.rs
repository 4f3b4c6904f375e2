//! Claims: how processes that share a folder divide its frames among themselves, without a server.
//!
//! A claim is a file beside the picture, `frame_0012.png.claim1`, that only one process can create
//! (`O_EXCL`, which NFS supports since version 3). Its owner rewrites it periodically; a claim that has
//! not been written for the timeout is stale, and another process may take the frame over.
//!
//! Ages are differences of times from the file server's clock, since the machines' clocks differ: the
//! claim's last write, and a write to a temporary file now. A claim from the future (the server's clock
//! was set back) is stale if it does not change for the timeout.
//!
//! A process takes over the stale claim `n` by creating claim `n + 1`, which again only one can; the
//! highest claim is valid. If stale claims were removed or renamed instead, a process that found one
//! stale shortly before could remove its successor.

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

/// Number of writes to a claim per timeout.
const BEATS_PER_TIMEOUT: u32 = 6;

/// A process's settings for claiming frames.
#[derive(Debug)]
pub struct Claims {
    owner: String,
    timeout: Duration,
    /// Claims from the future: their last write, and when it was first observed.
    future: Mutex<HashMap<PathBuf, (SystemTime, Instant)>>,
}

/// A frame claimed by this process, until this is dropped.
#[derive(Debug)]
pub struct Claim {
    picture: PathBuf,
    /// Number of this claim on the frame, from 1; lower ones are stale.
    number: u32,
    // Drop order: the writes stop, the file is removed, the cleanup list forgets it.
    heartbeat: Option<Heartbeat>,
    _cleanup: CleanupGuard,
}

impl Claims {
    /// Settings of claims that contain the text `owner`, for people, and are stale at an age of
    /// `timeout`.
    pub fn new(owner: String, timeout: Duration) -> Self {
        Self { owner, timeout, future: Mutex::default() }
    }

    /// The age at which a claim is stale.
    pub fn timeout(&self) -> Duration {
        self.timeout
    }

    /// Claims the frame with the picture file `picture`; `None` if another process has claimed it.
    ///
    /// The previous owner may have written the picture, so the caller must check for it again.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder cannot be written to, or if a link, a folder or a pipe has a claim's
    /// name.
    pub fn take(&self, picture: &Path) -> Result<Option<Claim>> {
        let mut stale: Option<(PathBuf, SystemTime)> = None;
        for number in 1.. {
            let path = claim_path(picture, number);
            let fail = |e: io::Error| Error::io(&path, "claim", e);
            match CleanupGuard::create(|| Ok((File::create_new(&path)?, path.clone()))) {
                Ok((file, cleanup)) => {
                    // If the stale claim was released meanwhile, another process may hold claim 1.
                    let is_released = |(path, time): &(PathBuf, SystemTime)| {
                        last_write(path).ok().as_ref() != Some(time)
                    };
                    if stale.as_ref().is_some_and(is_released) {
                        std::fs::remove_file(&path).map_err(fail)?;
                        return Ok(None);
                    }
                    let picture = picture.to_owned();
                    let mut claim = Claim { picture, number, heartbeat: None, _cleanup: cleanup };
                    write_heartbeat(&file, &self.owner).map_err(fail)?;
                    let interval = self.timeout / BEATS_PER_TIMEOUT;
                    let heartbeat = Heartbeat::start(file, self.owner.clone(), interval);
                    claim.heartbeat = Some(heartbeat.map_err(Error::Threads)?);
                    return Ok(Some(claim));
                }
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                Err(e) => return Err(fail(e)),
            }
            // Read before the claim's time: a suspension in between must not make the claim look stale.
            let now = output::file_time(picture)?;
            let time = match last_write(&path) {
                Ok(time) => time,
                // Released meanwhile.
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

    /// Whether a claim last written at `time` is stale.
    fn is_stale(&self, claim: &Path, time: SystemTime, now: SystemTime) -> bool {
        if let Ok(age) = now.duration_since(time) {
            return age > self.timeout;
        }
        let mut future = self.future.lock().unwrap_or_else(PoisonError::into_inner);
        let known = future.entry(claim.to_owned()).or_insert_with(|| (time, Instant::now()));
        if known.0 != time {
            *known = (time, Instant::now());
        }
        known.1.elapsed() > self.timeout
    }

    /// Describes the owner of a frame: the text in its claim, and the claim's path.
    pub fn holder(picture: &Path) -> String {
        const MAX_LENGTH: u64 = 200;
        let exists = |path: &PathBuf| path.symlink_metadata().is_ok();
        let claims = (1..).map(|number| claim_path(picture, number)).take_while(exists);
        let Some(path) = claims.last() else { return "nobody any more".into() };
        let mut owner = Vec::new();
        let read = File::open(&path).and_then(|file| file.take(MAX_LENGTH).read_to_end(&mut owner));
        let owner = match read {
            Ok(_) => printable(String::from_utf8_lossy(owner.trim_ascii()).into_owned()),
            Err(error) => format!("another user ({error})"),
        };
        format!("{owner}: {}", path.display())
    }

    /// Whether a frame has a claim, stale or not.
    pub fn exist(picture: &Path) -> bool {
        claim_path(picture, 1).exists()
    }
}

impl Drop for Claim {
    /// Releases the frame.
    fn drop(&mut self) {
        self.heartbeat = None;
        // A process that has taken the frame over, as this claim was stale, removes all claims.
        if claim_path(&self.picture, self.number + 1).exists() {
            return;
        }
        // Claim 1 first: a process that creates it anew holds the frame.
        for number in 1..=self.number {
            // A claim that cannot be removed becomes stale.
            let _ = std::fs::remove_file(claim_path(&self.picture, number));
        }
    }
}

/// Path of a claim: `frame_0012.png.claim1`.
fn claim_path(picture: &Path, number: u32) -> PathBuf {
    let mut name = picture.as_os_str().to_owned();
    name.push(format!(".claim{number}"));
    name.into()
}

/// Time of the last write to a claim.
fn last_write(claim: &Path) -> io::Result<SystemTime> {
    let metadata = claim.symlink_metadata()?;
    if !metadata.is_file() {
        let problem = "this is a link, a folder or a pipe, not a claim; remove it";
        return Err(io::Error::other(problem));
    }
    // Opening makes NFS revalidate the attributes; another user's claim may not be readable.
    match File::open(claim) {
        Ok(file) => file.metadata()?.modified(),
        Err(e) if e.kind() == ErrorKind::PermissionDenied => metadata.modified(),
        Err(e) => Err(e),
    }
}

/// Rewrites a claim, which updates its time.
fn write_heartbeat(mut file: &File, owner: &str) -> io::Result<()> {
    file.rewind()?;
    file.write_all(owner.as_bytes())?;
    file.sync_all()
}

/// A thread that rewrites a claim periodically, until this is dropped.
#[derive(Debug)]
struct Heartbeat {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Heartbeat {
    fn start(file: File, owner: String, every: Duration) -> io::Result<Self> {
        let (stop, stopped) = mpsc::channel();
        let thread = Builder::new().spawn(move || {
            while stopped.recv_timeout(every) == Err(RecvTimeoutError::Timeout) {
                // On failure, the frame may be taken over and drawn twice, to the same picture.
                let _ = write_heartbeat(&file, &owner);
            }
        })?;
        Ok(Self { stop: Some(stop), thread: Some(thread) })
    }
}

impl Drop for Heartbeat {
    /// Stops the thread and waits until it has closed the file.
    fn drop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            // The thread returns nothing.
            let _ = thread.join();
        }
    }
}
