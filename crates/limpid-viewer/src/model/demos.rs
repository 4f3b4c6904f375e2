//! The demos of the first screen, and their scene files.

#[cfg(not(target_arch = "wasm32"))]
use std::path::Path;

#[cfg(not(target_arch = "wasm32"))]
use limpid_io::error::Error;
use limpid_io::error::Result;
use limpid_io::files;
#[cfg(not(target_arch = "wasm32"))]
use limpid_io::{bake, output, project};

use crate::model::document::Source;

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
        scene: include_str!("../../demos/dam_break.toml"),
        picture: include_bytes!("../../demos/dam_break.jpg"),
    },
    Demo {
        name: "fountain",
        title: "Fountain",
        about: "simulated while it plays",
        scene: include_str!("../../demos/fountain.toml"),
        picture: include_bytes!("../../demos/fountain.jpg"),
    },
    Demo {
        name: "lagoon",
        title: "Lagoon",
        about: "bodies in and on clear water, in the sun",
        scene: limpid::sims::LAGOON,
        picture: include_bytes!("../../demos/lagoon.jpg"),
    },
    Demo {
        name: "vase",
        title: "Vase",
        about: "water in the shape of a vase, and its caustics",
        scene: limpid::sims::VASE,
        picture: include_bytes!("../../demos/vase.jpg"),
    },
];

/// The folder of the demos in a browser.
#[cfg(target_arch = "wasm32")]
pub(crate) const FOLDER: &str = "demos/";

/// The scene that a page shows first.
#[cfg(target_arch = "wasm32")]
pub(crate) const FIRST_SOURCE: &str = "demos/demo.toml";

/// Its files.
#[cfg(target_arch = "wasm32")]
const FIRST: [(&str, &[u8]); 2] = [
    ("demos/demo.toml", limpid::sims::DEMO.as_bytes()),
    ("demos/demo.bgeo", limpid::sims::DEMO_PARTICLES),
];

/// Gives the files of all demos to all who read files.
#[cfg(target_arch = "wasm32")]
pub(crate) fn give_all() {
    for demo in &DEMOS {
        files::given::give_bytes(demo.path(), demo.scene.as_bytes().to_vec());
    }
    for (path, bytes) in FIRST {
        files::given::give_bytes(path, bytes.to_vec());
    }
}

impl Demo {
    /// The source of the demo: a scene file in the user's cache folder. Frames of a simulation are stored beside it.
    ///
    /// # Errors
    /// [`Error::Io`] naming what cannot be written.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn source(&self) -> Result<Source> {
        let folder = output::cache_folder().unwrap_or_else(|| std::env::temp_dir().join("limpid"));
        self.source_in(&folder)
    }

    /// The source of the demo: a scene file in memory, which the worker has been given.
    ///
    /// # Errors
    /// None.
    #[cfg(target_arch = "wasm32")]
    pub fn source(&self) -> Result<Source> {
        Ok(Source::new(self.path()))
    }

    #[cfg(target_arch = "wasm32")]
    fn path(&self) -> String {
        format!("{FOLDER}{}.toml", self.name)
    }

    /// As [`Demo::source`], in another folder.
    ///
    /// # Errors
    /// As [`Demo::source`].
    #[cfg(not(target_arch = "wasm32"))]
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
