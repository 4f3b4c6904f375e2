//! Frames that a process sets aside for itself in a folder that several share, without a server.
//!
//! A claim is a file beside the picture, `frame_0012.png.claim1`, that only one process can create
//! (`O_EXCL`, which NFS has kept to since version 3). While its owner lives it is written to again
//! and again; one that has not been written to for a while is stale, and its frame is taken over.
//!
//! Ages are differences of times that the file server gave, since clocks of machines differ: what a
//! claim was last written at, and what a file of one's own is written at now.
//!
//! To take over the stale claim `n` is to create claim `n + 1`, which again only one can; the last
//! claim holds. Were it removed or renamed instead, a process that has found it stale a moment ago
//! would remove what another has put in its place.

use std::fs::File;
use std::io::{self, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};

use crate::error::{Error, Result};
use crate::output::{Litter, Temporary};

/// How often a claim is written to before it would be stale.
const BEATS: u32 = 6;

/// How a process claims frames.
#[derive(Debug, Clone)]
pub struct Claims {
    /// What the files say, for people to read: who it is.
    pub owner: String,
    /// The age at which a claim is stale.
    pub timeout: Duration,
}

/// A frame that is this process's to draw, until this is dropped.
#[derive(Debug)]
pub struct Claim {
    picture: PathBuf,
    /// Which claim on the frame this is, from 1; those before it are stale.
    number: u32,
    // In this order: nobody writes to it, then it is removed, then forgotten.
    heart: Option<Heart>,
    _litter: Litter,
}

impl Claims {
    /// Claims the frame whose picture is to be `picture`; `None` if it is another's.
    ///
    /// The owner before may have written the picture: look again.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder cannot be written to.
    pub fn take(&self, picture: &Path) -> Result<Option<Claim>> {
        let mut stale: Option<(PathBuf, SystemTime)> = None;
        for number in 1.. {
            let path = file(picture, number);
            let fail = |e: io::Error| Error::io(&path, "claim", e);
            match Litter::create(|| Ok((File::create_new(&path)?, path.clone()))) {
                Ok((file, litter)) => {
                    // Had the stale claim been given up meanwhile, another may hold the first one.
                    let given_up = |(path, time): &(PathBuf, SystemTime)| {
                        written(path).ok().as_ref() != Some(time)
                    };
                    if stale.as_ref().is_some_and(given_up) {
                        std::fs::remove_file(&path).map_err(fail)?;
                        return Ok(None);
                    }
                    let picture = picture.to_owned();
                    let mut claim = Claim { picture, number, heart: None, _litter: litter };
                    let heart = Heart::start(file, self.owner.clone(), self.timeout / BEATS);
                    claim.heart = Some(heart.map_err(fail)?);
                    return Ok(Some(claim));
                }
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
                Err(e) => return Err(fail(e)),
            }
            // This first: if this process sleeps in between, nobody looks dead.
            let now = now(picture)?;
            let Ok(time) = written(&path) else { return Ok(None) };
            if now.duration_since(time).unwrap_or_default() <= self.timeout {
                return Ok(None);
            }
            stale = Some((path, time));
        }
        Ok(None)
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

/// When a claim was last written to. It is opened, since that is when NFS asks the server.
fn written(claim: &Path) -> io::Result<SystemTime> {
    File::open(claim)?.metadata()?.modified()
}

/// The file server's time.
fn now(picture: &Path) -> Result<SystemTime> {
    let probe = Temporary::beside(picture)?;
    let mut file = probe.as_file();
    let time = file.write_all(b"?").and_then(|()| file.sync_all());
    time.and_then(|()| file.metadata()?.modified()).map_err(|e| Error::io(picture, "claim", e))
}

/// Writes to a claim again and again, until it is dropped.
#[derive(Debug)]
struct Heart {
    stop: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Heart {
    fn start(mut file: File, owner: String, every: Duration) -> io::Result<Self> {
        let mut beat = move || {
            file.rewind()?;
            file.write_all(owner.as_bytes())?;
            file.sync_all()
        };
        beat()?;
        let (stop, stopped) = mpsc::channel();
        let thread = std::thread::spawn(move || {
            while stopped.recv_timeout(every) == Err(RecvTimeoutError::Timeout) {
                // At worst the frame is taken over and drawn twice, to the same picture.
                let _ = beat();
            }
        });
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
