//! Which file a path names, and where that is.

use std::path::{Path, PathBuf};

/// The identity of a file: equal for all paths to it, by links of both kinds, also before it exists.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) enum Identity {
    #[cfg(unix)]
    Inode(u64, u64),
    Path(PathBuf),
}

impl Identity {
    /// `None` for anything but a regular file: several outputs may share a device.
    pub(crate) fn of(path: &Path) -> Option<Self> {
        match path.metadata() {
            Ok(metadata) if !metadata.is_file() => None,
            #[cfg(unix)]
            Ok(metadata) => {
                use std::os::unix::fs::MetadataExt as _;
                Some(Self::Inode(metadata.dev(), metadata.ino()))
            }
            #[cfg(not(unix))]
            Ok(_) => Some(Self::Path(path.canonicalize().unwrap_or_else(|_| path.to_owned()))),
            Err(_) => {
                let folder = folder_of(path);
                let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
                Some(Self::Path(folder.join(path.file_name()?)))
            }
        }
    }
}

/// The folder that a file is in, or would be.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}
