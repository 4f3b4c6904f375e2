//! Files of a browser, which has no file system: those that the page has given, and those that a server has.
//!
//! Reading blocks, so this is for a worker, where browsers allow that. The program that embeds the library says how
//! bytes are read ([`give`]) and fetched ([`fetch_with`]); this module knows no browser.

use std::cell::RefCell;
use std::collections::{BTreeMap, VecDeque};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::time::SystemTime;

use crate::pattern::placeholder;

/// Reads bytes of a file at an offset.
pub type ReadAt = Rc<dyn Fn(u64, &mut [u8]) -> io::Result<()>>;

/// Fetches what a URL names.
pub type Fetch = Rc<dyn Fn(&str) -> io::Result<Vec<u8>>>;

/// Memory of fetched files that are kept, bytes. The browser has a cache of its own.
const KEPT: u64 = 256 << 20;

/// The list of the names in a folder of a server, one a line. Without it, a page of the server that lists them is
/// read.
const LIST: &str = "files.txt";

#[derive(Clone)]
struct Entry {
    length: u64,
    read: ReadAt,
}

#[derive(Default)]
struct Store {
    /// Files that were given, also in folders of servers: the frames of a simulation.
    files: BTreeMap<PathBuf, Entry>,
    fetch: Option<Fetch>,
    /// Files of servers, the oldest first.
    fetched: VecDeque<(PathBuf, Entry)>,
    /// Memory of these, bytes.
    bytes: u64,
    /// Names in folders of servers.
    listed: BTreeMap<PathBuf, Vec<String>>,
}

thread_local! {
    static STORE: RefCell<Store> = RefCell::default();
}

/// Gives a file of `length` bytes, in place of one of the same path.
pub fn give(path: impl Into<PathBuf>, length: u64, read: ReadAt) {
    STORE.with_borrow_mut(|store| store.files.insert(path.into(), Entry { length, read }));
}

/// Gives a file in memory.
pub fn give_bytes(path: impl Into<PathBuf>, bytes: Vec<u8>) {
    let length = bytes.len() as u64;
    give(path, length, Rc::new(move |offset, buffer| copy(&bytes, offset, buffer)));
}

fn copy(bytes: &[u8], offset: u64, buffer: &mut [u8]) -> io::Result<()> {
    let part = usize::try_from(offset).ok().and_then(|at| bytes.get(at..)?.get(..buffer.len()));
    buffer.copy_from_slice(part.ok_or(io::ErrorKind::UnexpectedEof)?);
    Ok(())
}

/// Whether a file has been given.
pub fn has(path: &Path) -> bool {
    STORE.with_borrow(|store| store.files.contains_key(path))
}

/// Forgets what servers had, which may have changed.
pub fn forget_servers() {
    STORE.with_borrow_mut(|store| {
        store.listed.clear();
        store.fetched.clear();
        store.bytes = 0;
    });
}

/// Says which files are in a folder of a server, instead of a list there.
pub fn list(folder: &Path, names: Vec<String>) {
    STORE.with_borrow_mut(|store| store.listed.insert(folder.to_owned(), names));
}

/// Takes back all files in a folder.
pub fn take_back(folder: &Path) {
    STORE.with_borrow_mut(|store| store.files.retain(|path, _| !path.starts_with(folder)));
}

/// Fetches paths that begin with `http:` or `https:`.
pub fn fetch_with(fetch: Fetch) {
    STORE.with_borrow_mut(|store| store.fetch = Some(fetch));
}

/// The URL that a path stands for.
fn url(path: &Path) -> Option<String> {
    let text = path.to_str()?;
    let (scheme, rest) = text.split_once(":/")?;
    // Joining and normalising paths may drop the second slash.
    matches!(scheme, "http" | "https")
        .then(|| format!("{scheme}://{}", rest.trim_start_matches('/')))
}

fn fetched(url: &str) -> io::Result<Vec<u8>> {
    let fetch = STORE.with_borrow(|store| store.fetch.clone());
    fetch.ok_or(io::ErrorKind::Unsupported)?(url)
}

/// The file of a path, fetched if it is a URL.
fn entry(path: &Path) -> io::Result<Entry> {
    let known = STORE.with_borrow(|store| {
        let fetched = || store.fetched.iter().find(|(known, _)| known == path);
        store.files.get(path).or_else(|| Some(&fetched()?.1)).cloned()
    });
    if let Some(known) = known {
        return Ok(known);
    }
    let Some(url) = url(path) else { return Err(io::ErrorKind::NotFound.into()) };
    let bytes = fetched(&url)?;
    let length = bytes.len() as u64;
    let read: ReadAt = Rc::new(move |offset, buffer| copy(&bytes, offset, buffer));
    let entry = Entry { length, read };
    STORE.with_borrow_mut(|store| {
        store.fetched.push_back((path.to_owned(), entry.clone()));
        store.bytes += length;
        while store.bytes > KEPT && store.fetched.len() > 1 {
            let oldest = store.fetched.pop_front();
            store.bytes -= oldest.map_or(0, |(_, entry)| entry.length);
        }
    });
    Ok(entry)
}

/// The names of the given files and folders in a folder.
fn given_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = STORE.with_borrow(|store| {
        let inside = store.files.keys().filter_map(|file| file.strip_prefix(folder).ok());
        let first = inside.filter_map(|file| file.components().next());
        first.map(|name| name.as_os_str().to_string_lossy().into_owned()).collect()
    });
    // Sorted by path, equal ones are neighbours.
    names.dedup();
    names
}

/// Properties of a file or a folder.
#[derive(Debug, Clone, Copy)]
pub struct Metadata {
    length: u64,
    folder: bool,
}

impl Metadata {
    /// Length of a file, bytes.
    #[expect(clippy::len_without_is_empty, reason = "as in the standard library")]
    pub fn len(&self) -> u64 {
        self.length
    }

    /// Whether it is a file.
    pub fn is_file(&self) -> bool {
        !self.folder
    }

    /// Whether it is a folder.
    pub fn is_dir(&self) -> bool {
        self.folder
    }

    /// When it was changed, which browsers do not say.
    ///
    /// # Errors
    /// Always.
    pub fn modified(&self) -> io::Result<SystemTime> {
        Err(io::ErrorKind::Unsupported.into())
    }
}

/// The properties of a file or a folder. What is a folder of a server ends with a slash.
///
/// # Errors
/// [`io::ErrorKind::NotFound`], or as reading fails.
pub fn metadata(path: &Path) -> io::Result<Metadata> {
    let folder = Metadata { length: 0, folder: true };
    if !given_in(path).is_empty() || url(path).is_some_and(|url| url.ends_with('/')) {
        return Ok(folder);
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    if url(path).is_some() && (placeholder(&name).is_some() || name.contains('*')) {
        // A pattern; some servers answer any path with a page.
        return Err(io::ErrorKind::NotFound.into());
    }
    Ok(Metadata { length: entry(path)?.length, folder: false })
}

/// Whether this is a file that exists.
pub fn is_file(path: &Path) -> bool {
    metadata(path).is_ok_and(|metadata| metadata.is_file())
}

/// The names in a folder, in any order.
///
/// # Errors
/// [`io::ErrorKind::NotFound`]; of a server, an error that says how to list its files.
pub fn names_in(folder: &Path) -> io::Result<Vec<String>> {
    let names = given_in(folder);
    if !names.is_empty() {
        return Ok(names);
    }
    let Some(url) = url(folder) else { return Err(io::ErrorKind::NotFound.into()) };
    if let Some(known) = STORE.with_borrow(|store| store.listed.get(folder).cloned()) {
        return Ok(known);
    }
    let base = url.trim_end_matches('/');
    let text = |of: String| fetched(&of).ok().and_then(|bytes| String::from_utf8(bytes).ok());
    // Servers that answer every path with a page have no list.
    let list = text(format!("{base}/{LIST}")).filter(|list| !list.trim_start().starts_with('<'));
    let names = match list {
        Some(list) => list.lines().map(|line| line.trim().to_owned()).collect(),
        None => text(format!("{base}/")).map(|page| linked(&page)).unwrap_or_default(),
    };
    if names.is_empty() {
        let problem =
            format!("the server lists no files here; put {LIST} beside them, one name a line");
        return Err(io::Error::other(problem));
    }
    STORE.with_borrow_mut(|store| store.listed.insert(folder.to_owned(), names.clone()));
    Ok(names)
}

/// The names that a server's page of a folder links to.
fn linked(page: &str) -> Vec<String> {
    let links = page.split("href=\"").skip(1).filter_map(|rest| rest.split('"').next());
    let names = links.filter(|link| !link.contains(['/', '?', '#', ':']));
    names.map(|name| name.replace("%20", " ").replace("%7B", "{").replace("%7D", "}")).collect()
}

/// An open file.
pub struct File {
    path: PathBuf,
    length: u64,
    position: u64,
}

impl File {
    /// Opens a file.
    ///
    /// # Errors
    /// As [`metadata`].
    pub fn open(path: &Path) -> io::Result<Self> {
        Ok(Self { path: path.to_owned(), length: entry(path)?.length, position: 0 })
    }

    /// Its properties now.
    ///
    /// # Errors
    /// As [`metadata`].
    pub fn metadata(&self) -> io::Result<Metadata> {
        metadata(&self.path)
    }

    /// Fills a buffer from an offset.
    ///
    /// # Errors
    /// As reading fails.
    pub fn read_exact_at(&self, buffer: &mut [u8], offset: u64) -> io::Result<()> {
        let Entry { length, read } = entry(&self.path)?;
        if offset.saturating_add(buffer.len() as u64) > length {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        read(offset, buffer)
    }
}

impl Read for File {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = self.length.saturating_sub(self.position);
        let count = usize::try_from(left).unwrap_or(usize::MAX).min(buffer.len());
        self.read_exact_at(&mut buffer[..count], self.position)?;
        self.position += count as u64;
        Ok(count)
    }
}

impl Seek for File {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let to = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.length.checked_add_signed(by),
            SeekFrom::Current(by) => self.position.checked_add_signed(by),
        };
        self.position = to.ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.position)
    }
}
