//! The folder of a site: written beside its place, and put there once it is complete.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use limpid_io::output::{self, CleanupGuard, folder_of};
use limpid_io::{Error, Result};
use tempfile::TempDir;

/// The list of a site's files, whose first line says who wrote them.
const LIST: &str = "site.txt";
const HEAD: &str = "# Files of this site, by `limpid web`, which replaces a site that has these files and no others:";

/// A site that is being written. Dropping it leaves what was there before.
#[derive(Debug)]
pub(super) struct Site {
    // Drop order: the folder is removed, then the cleanup list forgets it.
    folder: TempDir,
    _cleanup: CleanupGuard,
    /// The place of the site, with links followed.
    place: PathBuf,
    /// As the user named it.
    output: PathBuf,
    /// Its files so far, by their paths in it.
    files: Vec<String>,
    bytes: u64,
}

impl Site {
    /// Begins a site at `output`, which is nothing, an empty folder or an older site.
    ///
    /// # Errors
    /// [`Error::Usage`] for a folder with files that this command has not written; [`Error::Io`] where none can be made.
    pub(super) fn begin(output: &Path) -> Result<Self> {
        output::check_folder(output)?;
        if output.exists() {
            check_is_ours(output)?;
        }
        let place = output.canonicalize().unwrap_or_else(|_| output.to_owned());
        let parent = folder_of(&place);
        fs::create_dir_all(parent).map_err(|e| Error::io(parent, "create", e))?;
        let created = CleanupGuard::create(|| {
            let folder = temporary(&place)?;
            let path = folder.path().to_owned();
            Ok((folder, path))
        });
        let (folder, _cleanup) = created.map_err(|e| Error::io(output, "write", e))?;
        let (output, files) = (output.to_owned(), Vec::new());
        Ok(Self { folder, _cleanup, place, output, files, bytes: 0 })
    }

    /// The path of a file until the site is complete.
    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Copies a file, however large, to a path in the site.
    ///
    /// # Errors
    /// [`Error::Usage`] for a file in the site that is to be replaced; [`Error::Io`].
    pub(super) fn copy(&mut self, from: &Path, name: &str) -> Result<()> {
        let read = |e: io::Error| Error::io(from, "read", e);
        let source = from.canonicalize().map_err(read)?;
        if source.starts_with(&self.place) {
            let (from, site) = (from.display(), self.output.display());
            let problem =
                format!("{from} is in {site}, which would be replaced; choose another -o");
            return Err(Error::Usage(problem));
        }
        let mut source = File::open(source).map_err(read)?;
        self.write_with(name, |file| io::copy(&mut source, file))
    }

    /// Writes a file of the site.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn write(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        self.write_with(name, |file| file.write_all(bytes).map(|()| bytes.len() as u64))
    }

    fn write_with(
        &mut self,
        name: &str,
        write: impl FnOnce(&mut File) -> io::Result<u64>,
    ) -> Result<()> {
        let path = self.path(name);
        let written = fs::create_dir_all(folder_of(&path))
            .and_then(|()| File::create_new(&path))
            .and_then(|mut file| write(&mut file));
        self.bytes += written.map_err(|e| Error::io(&self.output.join(name), "write", e))?;
        self.files.push(name.to_owned());
        Ok(())
    }

    /// Puts the site in its place, and removes an older one. Returns its length, bytes.
    ///
    /// # Errors
    /// [`Error::Io`]; the older one is then where it was.
    pub(super) fn finish(mut self) -> Result<u64> {
        let list = format!("{HEAD}\n{}\n{LIST}\n", self.files.join("\n"));
        self.write(LIST, list.as_bytes())?;
        let fail = |e: io::Error| Error::io(&self.output, "write", e);
        if self.place.exists() {
            // Another program may have written there meanwhile.
            check_is_ours(&self.output)?;
            // Not on the cleanup list: a signal between the renames must not remove the only one.
            let before = temporary(&self.place).map_err(fail)?;
            let old = before.path().join("site");
            fs::rename(&self.place, &old).map_err(fail)?;
            if let Err(error) = fs::rename(self.folder.path(), &self.place) {
                fs::rename(&old, &self.place).map_err(fail)?;
                return Err(fail(error));
            }
        } else {
            fs::rename(self.folder.path(), &self.place).map_err(fail)?;
        }
        Ok(self.bytes)
    }
}

/// Makes a folder beside `place`, with the permissions of ordinary ones.
fn temporary(place: &Path) -> io::Result<TempDir> {
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
    builder.prefix(".limpid-").tempdir_in(folder_of(place))
}

/// Fails unless a folder is empty, or has the files of its list and no others.
fn check_is_ours(folder: &Path) -> Result<()> {
    let list = fs::read_to_string(folder.join(LIST)).unwrap_or_default();
    let mut lines = list.lines();
    let is_site = lines.next() == Some(HEAD);
    let known: BTreeSet<&str> = if is_site { lines.collect() } else { BTreeSet::new() };
    let foreign = find_foreign(folder, "", &known).map_err(|e| Error::io(folder, "list", e))?;
    match foreign {
        Some(name) => {
            let folder = folder.display();
            Err(Error::Usage(format!(
                "{folder}: `limpid web` did not write {name}, and leaves the folder as it is; choose another -o, or \
                 remove it yourself"
            )))
        }
        None => Ok(()),
    }
}

/// The first file below a folder that is not known.
fn find_foreign(folder: &Path, inside: &str, known: &BTreeSet<&str>) -> io::Result<Option<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = format!("{inside}{}", entry.file_name().to_string_lossy());
        names.push((name, entry.file_type()?.is_dir(), entry.path()));
    }
    names.sort();
    for (name, is_folder, path) in names {
        let foreign = match is_folder {
            true => find_foreign(&path, &format!("{name}/"), known)?,
            false => (!known.contains(name.as_str())).then_some(name),
        };
        if foreign.is_some() {
            return Ok(foreign);
        }
    }
    Ok(None)
}
