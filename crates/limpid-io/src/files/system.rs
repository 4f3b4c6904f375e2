//! Files of the operating system.

use std::io;
use std::path::Path;

pub use std::fs::{File, Metadata, metadata};

/// Whether this is a file that exists.
pub fn is_file(path: &Path) -> bool {
    path.is_file()
}

/// The names in a folder, in any order, except those that are not Unicode.
pub fn names_in(folder: &Path) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        names.extend(entry?.file_name().into_string());
    }
    Ok(names)
}
