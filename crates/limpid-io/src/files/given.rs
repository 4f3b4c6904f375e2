//! Files of a browser, which has no file system: those that the page has given, and those that a server has.
//!
//! Reading blocks, so this is for a worker, where browsers allow that. The program that embeds the library says how
//! bytes are read ([`give`]) and fetched ([`fetch_with`]); this module knows no browser.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io::{self, Read, Seek, SeekFrom};
use std::ops::Bound;
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;
use std::time::SystemTime;

use percent_encoding::percent_decode_str;

use crate::pattern::placeholder;

/// Reads bytes of a file at an offset.
pub type ReadAt = Rc<dyn Fn(u64, &mut [u8]) -> io::Result<()>>;

/// Fetches the contents of a URL.
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
    /// Queries of all requests below folders of servers.
    queries: BTreeMap<PathBuf, String>,
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

/// A path without `.` and `..`, and from its last URL on: a scene's files are named from its folder, but may be URLs.
fn normal(path: &Path) -> PathBuf {
    let mut normal = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir => drop(normal.pop()),
            Component::Normal(name) if name == "http:" || name == "https:" => normal = name.into(),
            part => normal.push(part),
        }
    }
    normal
}

/// Gives a file of `length` bytes, in place of one of the same path.
pub fn give(path: impl AsRef<Path>, length: u64, read: ReadAt) {
    let path = normal(path.as_ref());
    STORE.with_borrow_mut(|store| store.files.insert(path, Entry { length, read }));
}

/// Gives a file in memory.
pub fn give_bytes(path: impl AsRef<Path>, bytes: Vec<u8>) {
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
    STORE.with_borrow(|store| store.files.contains_key(&normal(path)))
}

/// Forgets files from servers, which may have changed.
pub fn forget_servers() {
    STORE.with_borrow_mut(|store| {
        store.listed.clear();
        store.fetched.clear();
        store.bytes = 0;
    });
}

/// Says which files are in a folder of a server, instead of a list there.
pub fn list(folder: &Path, names: Vec<String>) {
    STORE.with_borrow_mut(|store| store.listed.insert(normal(folder), names));
}

/// Takes back all files in a folder.
pub fn take_back(folder: &Path) {
    let folder = normal(folder);
    STORE.with_borrow_mut(|store| store.files.retain(|path, _| !path.starts_with(&folder)));
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

/// A URL without its query, as a path: a name must end with its extension. The query, such as a signature, is part of
/// all further requests in its folder and below. Anything else is returned as it is.
pub fn without_query(address: &str) -> String {
    let Some((plain, query)) = address.split_once('?') else { return address.into() };
    let Some(folder) = Path::new(plain).parent().filter(|folder| url(folder).is_some()) else {
        return address.into();
    };
    STORE.with_borrow_mut(|store| store.queries.insert(normal(folder), query.to_owned()));
    plain.into()
}

fn with_query(url: &str) -> String {
    let path = normal(Path::new(url));
    let query = STORE.with_borrow(|store| {
        path.ancestors().find_map(|folder| store.queries.get(folder)).cloned()
    });
    query.map_or(url.to_owned(), |query| format!("{url}?{query}"))
}

fn fetched(url: &str) -> io::Result<Vec<u8>> {
    let fetch = STORE.with_borrow(|store| store.fetch.clone());
    fetch.ok_or(io::ErrorKind::Unsupported)?(&with_query(url))
}

/// The file of a normal path, if it has been given or fetched.
fn known(path: &Path) -> Option<Entry> {
    STORE.with_borrow(|store| {
        let fetched = || store.fetched.iter().find(|(known, _)| known == path);
        store.files.get(path).or_else(|| Some(&fetched()?.1)).cloned()
    })
}

/// The URL to fetch for the file of a path: with its query, and `None` if it is known already.
pub fn missing(path: &Path) -> Option<String> {
    let path = normal(path);
    if known(&path).is_some() {
        return None;
    }
    url(&path).map(|url| with_query(&url))
}

/// Keeps the contents of a file of a server, as if it had been fetched.
pub fn keep(path: &Path, bytes: Vec<u8>) {
    kept(normal(path), bytes);
}

/// The file of a path, fetched if it is a URL.
fn entry(path: &Path) -> io::Result<Entry> {
    let path = normal(path);
    if let Some(known) = known(&path) {
        return Ok(known);
    }
    let Some(url) = url(&path) else { return Err(io::ErrorKind::NotFound.into()) };
    Ok(kept(path, fetched(&url)?))
}

fn kept(path: PathBuf, bytes: Vec<u8>) -> Entry {
    let length = bytes.len() as u64;
    let read: ReadAt = Rc::new(move |offset, buffer| copy(&bytes, offset, buffer));
    let entry = Entry { length, read };
    STORE.with_borrow_mut(|store| {
        store.fetched.push_back((path, entry.clone()));
        store.bytes += length;
        while store.bytes > KEPT && store.fetched.len() > 1 {
            let oldest = store.fetched.pop_front();
            store.bytes -= oldest.map_or(0, |(_, entry)| entry.length);
        }
    });
    entry
}

/// The given files in a folder and below, without that folder.
fn given_in(folder: &Path) -> Vec<PathBuf> {
    let folder = normal(folder);
    STORE.with_borrow(|store| {
        let from = store.files.range::<Path, _>((Bound::Excluded(&*folder), Bound::Unbounded));
        let inside = from.map_while(|(file, _)| file.strip_prefix(&folder).ok());
        inside.map(Path::to_owned).collect()
    })
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

/// The properties of a file or a folder. The name of a server's folder ends with a slash.
///
/// # Errors
/// [`io::ErrorKind::NotFound`], or as reading fails.
pub fn metadata(path: &Path) -> io::Result<Metadata> {
    let is_folder = || !has(path) && !given_in(path).is_empty();
    if url(path).is_some_and(|url| url.ends_with('/')) || is_folder() {
        return Ok(Metadata { length: 0, folder: true });
    }
    if url(path).is_some() && !is_one_file(path) {
        // Some servers answer any path with a page.
        return Err(io::ErrorKind::NotFound.into());
    }
    Ok(Metadata { length: entry(path)?.length, folder: false })
}

/// Whether a path is that of one file, neither a pattern nor a folder of a server.
pub fn is_one_file(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let is_pattern = placeholder(&name).is_some() || name.contains('*');
    !is_pattern && !path.to_string_lossy().ends_with('/')
}

/// Whether this is a file that exists.
pub fn is_file(path: &Path) -> bool {
    metadata(path).is_ok_and(|metadata| metadata.is_file())
}

/// The names in a folder, in any order: of a server's folder those that the server lists, unless files have been given
/// there.
///
/// # Errors
/// [`io::ErrorKind::NotFound`]; of a server, an error that says how to list its files.
pub fn names_in(folder: &Path) -> io::Result<Vec<String>> {
    let given = given_in(folder);
    let mut names = BTreeSet::new();
    names.extend(given.iter().filter_map(|file| file.components().next()));
    let names: Vec<String> =
        names.into_iter().map(|name| name.as_os_str().to_string_lossy().into_owned()).collect();
    let is_file = |file: &PathBuf| file.components().count() == 1;
    match url(folder) {
        Some(url) if !given.iter().any(is_file) => listed(folder, &url),
        _ if names.is_empty() => Err(io::ErrorKind::NotFound.into()),
        _ => Ok(names),
    }
}

/// The names in a folder of a server.
fn listed(folder: &Path, url: &str) -> io::Result<Vec<String>> {
    let folder = normal(folder);
    if let Some(known) = STORE.with_borrow(|store| store.listed.get(&folder).cloned()) {
        return Ok(known);
    }
    let base = url.trim_end_matches('/');
    let text = |of: String| match fetched(&of) {
        Ok(bytes) => Ok(String::from_utf8(bytes).ok()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    };
    let list = text(format!("{base}/{LIST}"));
    let names = match &list {
        // Servers that answer every path with a page have no list.
        Ok(Some(list)) if !list.trim_start().starts_with('<') => {
            list.lines().map(|line| line.trim().to_owned()).collect()
        }
        _ => match text(format!("{base}/")) {
            Ok(page) => linked(&page.unwrap_or_default()),
            // A server may forbid one of them.
            Err(error) => return Err(list.err().unwrap_or(error)),
        },
    };
    if names.is_empty() {
        let problem =
            format!("the server lists no files here; put {LIST} beside them, one name a line");
        return Err(io::Error::other(problem));
    }
    STORE.with_borrow_mut(|store| store.listed.insert(folder, names.clone()));
    Ok(names)
}

/// The names that a server's page of a folder links to.
fn linked(page: &str) -> Vec<String> {
    let links = page.split("href=\"").skip(1).filter_map(|rest| rest.split('"').next());
    let names = links.map(|link| link.strip_prefix("./").unwrap_or(link));
    let names = names.filter(|name| !name.contains(['/', '?', '#', ':']));
    names.map(|name| percent_decode_str(name).decode_utf8_lossy().into_owned()).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A server with these files, by URL.
    fn serve(files: &'static [(&str, &str)]) {
        fetch_with(Rc::new(|url| match files.iter().find(|(known, _)| *known == url) {
            Some((_, "forbidden")) => Err(io::Error::other("the server answers 403")),
            Some((_, text)) => Ok((*text).into()),
            None => Err(io::ErrorKind::NotFound.into()),
        }));
    }

    fn text(path: &str) -> io::Result<String> {
        let mut text = String::new();
        File::open(Path::new(path))?.read_to_string(&mut text).map(|_| text)
    }

    /// Scenes name files from their folder, also above it, and by URLs.
    #[test]
    fn paths_are_those_of_a_file_system() {
        serve(&[("https://host/a/water.bgeo", "of the server")]);
        give_bytes("files/frames/water_1.bgeo", b"first".into());
        give_bytes("files/frames-old/water_1.bgeo", b"old".into());
        assert_eq!(text("files/scenes/../frames/./water_1.bgeo").unwrap(), "first");
        assert_eq!(text("files/https://host/a/water.bgeo").unwrap(), "of the server");
        assert_eq!(text("files/water_1.bgeo").unwrap_err().kind(), io::ErrorKind::NotFound);
        assert_eq!(names_in(Path::new("files/frames")).unwrap(), ["water_1.bgeo"]);
        assert_eq!(names_in(Path::new("files")).unwrap(), ["frames", "frames-old"]);
        assert!(metadata(Path::new("files/frames")).unwrap().is_dir());
        assert!(is_file(Path::new("files/frames/water_1.bgeo")));
        take_back(Path::new("files/frames"));
        assert!(!has(Path::new("files/frames/water_1.bgeo")));
        assert!(has(Path::new("files/frames-old/water_1.bgeo")));
    }

    /// The query of a URL, such as a signature, is part of all requests in its folder and below, and of no others.
    #[test]
    fn queries_are_sent_again() {
        serve(&[
            ("https://host/a/scene.toml?key=a/b", "scene"),
            ("https://host/a/frames/water_1.bgeo?key=a/b", "frame"),
            ("https://host/b/water.bgeo", "other"),
        ]);
        assert_eq!(without_query("https://host/a/scene.toml?key=a/b"), "https://host/a/scene.toml");
        assert_eq!(without_query("files/what?.bgeo"), "files/what?.bgeo");
        assert_eq!(text("https://host/a/scene.toml").unwrap(), "scene");
        let frame = Path::new("https://host/a/frames/water_1.bgeo");
        assert_eq!(missing(frame).unwrap(), "https://host/a/frames/water_1.bgeo?key=a/b");
        assert_eq!(text("https://host/a/frames/water_1.bgeo").unwrap(), "frame");
        assert_eq!(missing(frame), None);
        assert_eq!(text("https://host/b/water.bgeo").unwrap(), "other");
    }

    /// Names of a server's folder come from its list, or from its page of the folder; given files hide them only where
    /// they are. Without names the cause is told.
    #[test]
    fn folders_of_servers_are_listed() {
        serve(&[
            ("https://host/list/files.txt", "water_1.bgeo\n water_2.bgeo\n"),
            ("https://host/page/files.txt", "<html>every path has this</html>"),
            (
                "https://host/page/",
                r#"<a href="../">up</a> <a href="./w%C3%A4sser_1.bgeo">w</a> <a href="b%7B.vtk">"#,
            ),
            ("https://host/closed/files.txt", "forbidden"),
            ("https://host/closed/", "forbidden"),
        ]);
        let names = |folder: &str| names_in(Path::new(folder)).map_err(|error| error.to_string());
        assert_eq!(names("https://host/list").unwrap(), ["water_1.bgeo", "water_2.bgeo"]);
        assert_eq!(names("https://host/page/").unwrap(), ["w\u{e4}sser_1.bgeo", "b{.vtk"]);
        assert_eq!(names("https://host/closed").unwrap_err(), "the server answers 403");
        assert!(names("https://host/none").unwrap_err().contains("put files.txt beside them"));
        give_bytes("https://host/list/baked/dam/dam_0001.bgeo", Vec::new());
        assert_eq!(names("https://host/list").unwrap(), ["water_1.bgeo", "water_2.bgeo"]);
        assert_eq!(names("https://host/list/baked/dam").unwrap(), ["dam_0001.bgeo"]);
    }

    /// Files that have been fetched are kept until what servers have may have changed.
    #[test]
    fn fetched_files_are_forgotten() {
        serve(&[("https://host/a.bgeo", "particles")]);
        assert_eq!(text("https://host/a.bgeo").unwrap(), "particles");
        serve(&[]);
        assert_eq!(text("https://host/a.bgeo").unwrap(), "particles");
        forget_servers();
        assert_eq!(text("https://host/a.bgeo").unwrap_err().kind(), io::ErrorKind::NotFound);
    }
}
