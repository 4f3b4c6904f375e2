//! The demos as files in the user's cache folder.

use std::path::Path;

use crate::model::demos::Demo;
use crate::model::document::Source;
use limpid_io::error::{Error, Result};
use limpid_io::{bake, files, output, project};

impl Demo {
    /// The source of the demo: a scene file in the user's cache folder. Frames of a simulation are stored beside it.
    ///
    /// # Errors
    /// [`Error::Io`] naming what cannot be written.
    pub fn source(&self) -> Result<Source> {
        let folder = output::cache_folder().unwrap_or_else(|| std::env::temp_dir().join("limpid"));
        self.source_in(&folder)
    }

    /// As [`Demo::source`], in another folder.
    ///
    /// # Errors
    /// As [`Demo::source`].
    pub fn source_in(&self, folder: &Path) -> Result<Source> {
        let path = folder.join(self.name).with_extension("toml");
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
