//! The demos as files in the user's cache folder.

use std::path::{Path, PathBuf};

use crate::model::demos::{DEMOS, Demo};
use crate::model::document::Source;
use limpid_io::error::{Error, Result};
use limpid_io::{bake, files, output, project};

impl Demo {
    /// The source of the demo: a scene file in the user's cache folder. Frames of a simulation are stored beside it.
    ///
    /// # Errors
    /// [`Error::Io`] naming what cannot be written.
    pub fn source(&self) -> Result<Source> {
        self.source_in(&folder())
    }

    /// The demo whose scene file this is.
    pub(crate) fn of(input: &str) -> Option<&'static Self> {
        let folder = folder();
        DEMOS.iter().find(|demo| demo.path_in(&folder) == Path::new(input))
    }

    fn path_in(&self, folder: &Path) -> PathBuf {
        folder.join(self.name).with_extension("toml")
    }

    /// As [`Demo::source`], in another folder.
    ///
    /// # Errors
    /// As [`Demo::source`].
    pub fn source_in(&self, folder: &Path) -> Result<Source> {
        let path = self.path_in(folder);
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
        if files::read_text(&path).ok().as_deref() != Some(self.scene) {
            // Frames of an older version show another liquid.
            bake::clear(self.name, &bake::folder(&path))?;
            output::write_atomically(&path, project::FILE_KIND, |file| {
                std::io::Write::write_all(file, self.scene.as_bytes())
            })?;
        }
        Ok(Source::new(path.to_string_lossy()))
    }
}

/// The folder of their scene files.
fn folder() -> PathBuf {
    output::cache_folder().unwrap_or_else(|| std::env::temp_dir().join("limpid"))
}
