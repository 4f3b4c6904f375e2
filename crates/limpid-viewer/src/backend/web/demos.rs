//! The demos as files in memory, which the worker is given.

use crate::model::demos::{DEMOS, Demo};
use crate::model::document::Source;
use limpid_io::error::Result;
use limpid_io::files;

/// The folder of the demos in a browser.
pub(crate) const FOLDER: &str = "demos/";

/// The frame of the first demo for users who do not want motion: the wave has reached the pillar.
pub(crate) const STILL_FRAME: i64 = 24;

/// The scene that a page shows first.
pub(crate) fn first_source() -> String {
    DEMOS[0].path()
}

/// Gives the files of all demos to all who read files.
pub(crate) fn give_all() {
    for demo in &DEMOS {
        files::given::give_bytes(demo.path(), demo.scene.as_bytes().to_vec());
    }
}

impl Demo {
    /// The source of the demo: a scene file in memory, which the worker has been given.
    ///
    /// # Errors
    /// None.
    pub fn source(&self) -> Result<Source> {
        Ok(Source::new(self.path()))
    }

    /// The demo whose scene file this is.
    pub(crate) fn of(input: &str) -> Option<&'static Self> {
        DEMOS.iter().find(|demo| demo.path() == input)
    }

    fn path(&self) -> String {
        format!("{FOLDER}{}.toml", self.name)
    }
}
