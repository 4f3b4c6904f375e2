//! The demos of the first screen, and their scene files.

use std::path::Path;

use limpid_io::error::{Error, Result};
use limpid_io::{bake, files, output, project};

use crate::document::Source;

/// A scene that comes with the program.
#[derive(Debug)]
pub struct Demo {
    /// File name without its extension.
    pub name: &'static str,
    /// Title.
    pub title: &'static str,
    /// What it is.
    pub about: &'static str,
    /// The scene file.
    scene: &'static str,
    /// A JPEG picture of it.
    pub(crate) picture: &'static [u8],
}

/// The demos, in display order.
pub static DEMOS: [Demo; 4] = [
    Demo {
        name: "dam_break",
        title: "Breaking dam",
        about: "simulated while it plays",
        scene: include_str!("../demos/dam_break.toml"),
        picture: include_bytes!("../demos/dam_break.jpg"),
    },
    Demo {
        name: "fountain",
        title: "Fountain",
        about: "simulated while it plays",
        scene: include_str!("../demos/fountain.toml"),
        picture: include_bytes!("../demos/fountain.jpg"),
    },
    Demo {
        name: "lagoon",
        title: "Lagoon",
        about: "bodies in and on clear water, in the sun",
        scene: include_str!("../../../sims/lagoon.toml"),
        picture: include_bytes!("../demos/lagoon.jpg"),
    },
    Demo {
        name: "vase",
        title: "Vase",
        about: "water in the shape of a vase, and its caustics",
        scene: include_str!("../../../sims/vase.toml"),
        picture: include_bytes!("../demos/vase.jpg"),
    },
];

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
