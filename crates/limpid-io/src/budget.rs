//! The memory that one document may take.

use std::cell::{Cell, RefCell};
use std::collections::HashSet;
use std::path::Path;

use crate::error::{Error, Location, Result, Unpacked};
use crate::identity::Identity;

/// Default memory limit of a file of `packed` bytes, in bytes: a hundred times its length, at least 1
/// GiB and at most 16 GiB. Simulators' files hardly compress to half their size, so larger ratios are
/// crafted.
pub fn unpacked_limit(packed: u64) -> u64 {
    packed.saturating_mul(100).clamp(1 << 30, 16 << 30)
}

/// Memory for one document: a file together with all files that it lists, unpacked, and the contents read from them.
/// Parts share it, so that no list makes more of small files than one file may.
#[derive(Debug)]
pub(crate) struct Budget {
    /// The limit that the user has set, bytes.
    set: Option<u64>,
    /// Length of its files so far, each counted once, bytes.
    length: Cell<u64>,
    files: RefCell<HashSet<Identity>>,
    used: Cell<u64>,
    /// Whether it is of meshes instead of particles.
    meshes: bool,
}

impl Budget {
    /// A budget of `limit` bytes, or as the length of its files warrants, which are added as they are opened.
    pub(crate) fn new(limit: Option<u64>) -> Self {
        let (length, used) = (Cell::default(), Cell::default());
        Self { set: limit, length, files: RefCell::default(), used, meshes: false }
    }

    /// The budget of the meshes of a document, and their pictures.
    pub(crate) fn of_meshes() -> Self {
        Self { meshes: true, ..Self::new(None) }
    }

    /// The budget of a document in memory of `length` bytes.
    pub(crate) fn of_length(limit: Option<u64>, length: u64) -> Self {
        Self { length: length.into(), ..Self::new(limit) }
    }

    /// Adds a file of the document; again under whatever name, it warrants no more.
    pub(crate) fn add_file(&self, path: &Path, length: u64) {
        let new = Identity::of(path).is_none_or(|file| self.files.borrow_mut().insert(file));
        if new {
            self.length.set(self.length.get().saturating_add(length));
        }
    }

    /// The limit, bytes.
    pub(crate) fn limit(&self) -> u64 {
        self.set.unwrap_or_else(|| unpacked_limit(self.length.get()))
    }

    /// Memory that was taken, bytes.
    pub(crate) fn used(&self) -> u64 {
        self.used.get()
    }

    /// Gives back all memory that was taken since `used` bytes were.
    pub(crate) fn rewind(&self, used: u64) {
        self.used.set(used);
    }

    /// Memory that is left, bytes.
    pub(crate) fn left(&self) -> u64 {
        self.limit().saturating_sub(self.used.get())
    }

    /// Takes `bytes` for something made of `path`.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if less is left.
    pub(crate) fn take(&self, bytes: u64, path: &Path, location: Location) -> Result<()> {
        if bytes > self.left() {
            return Err(self.exceeded(path, location));
        }
        self.used.set(self.used.get() + bytes);
        Ok(())
    }

    /// The error of a file that takes more than is left.
    pub(crate) fn exceeded(&self, path: &Path, location: Location) -> Error {
        let what = match self.files.borrow().len() {
            _ if self.meshes => Unpacked::Meshes,
            0 | 1 => Unpacked::File,
            _ => Unpacked::Files,
        };
        Error::TooLarge { path: path.to_owned(), location, what, limit: self.limit() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// Parts share the limit; a file warrants memory once, under all of its names and links.
    #[test]
    fn files_of_a_document_share_it() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a"), folder.path().join("b"));
        fs::write(&a, "a").unwrap();
        fs::hard_link(&a, &b).unwrap();
        fs::create_dir(folder.path().join("c")).unwrap();
        let budget = Budget::new(None);
        for path in [&a, &b, &folder.path().join("c/../a")] {
            budget.add_file(path, 20 << 20);
        }
        assert_eq!(budget.limit(), 2000 << 20);
        let place = Location::Byte(7);
        assert!(budget.take(1500 << 20, &a, place.clone()).is_ok());
        assert_eq!(budget.left(), 500 << 20);
        let error = budget.take((500 << 20) + 1, &b, place.clone()).unwrap_err();
        assert!(matches!(error, Error::TooLarge { limit, .. } if limit == 2000 << 20), "{error}");
        assert!(budget.take(500 << 20, &b, place).is_ok(), "a refused part takes nothing");

        let set = Budget::new(Some(10));
        set.add_file(&a, 1 << 40);
        assert_eq!((set.limit(), set.left()), (10, 10));
    }
}
