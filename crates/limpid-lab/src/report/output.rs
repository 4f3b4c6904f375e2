//! The files of a report.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use limpid_io::error::Result;
use limpid_io::output::{self, FileKind, Files};

use super::{Report, html, markdown};

/// Where a report is written.
#[derive(Debug, Clone)]
pub struct Output {
    /// Folder of `report.html`, `report.md` and the figures. It must exist.
    pub folder: PathBuf,
    /// The file of the JSON.
    pub json: PathBuf,
}

impl Output {
    /// The page.
    pub fn page(&self) -> PathBuf {
        self.folder.join("report.html")
    }

    fn tables(&self) -> PathBuf {
        self.folder.join("report.md")
    }

    /// Checks the files before the measurements, which take minutes; `files` has what is read.
    ///
    /// # Errors
    /// As [`Files::writes`].
    pub fn check(&self, files: &mut Files) -> Result<()> {
        files.writes(&self.json, FileKind::MEASUREMENTS)?;
        files.writes(&self.page(), FileKind::PAGE)?;
        files.writes(&self.tables(), FileKind::TABLES)
    }

    /// Writes all files.
    ///
    /// # Errors
    /// [`Error::Io`](limpid_io::Error::Io) naming the file.
    pub fn write(&self, report: &Report) -> Result<()> {
        let json = serde_json::to_string_pretty(report).expect("a report has names and numbers");
        write_text(&self.json, FileKind::MEASUREMENTS, &json)?;
        write_text(&self.page(), FileKind::PAGE, &html(report))?;
        write_text(&self.tables(), FileKind::TABLES, &markdown(report))?;
        for figure in &report.figures {
            for (number, (_, picture)) in figure.panels.iter().enumerate() {
                let name = format!("{}-{number}.png", figure.scene.replace(':', "-"));
                output::write_png(&self.folder.join(name), picture)?;
            }
        }
        Ok(())
    }
}

pub(super) fn write_text(path: &Path, kind: FileKind, text: &str) -> Result<()> {
    output::write_atomically(path, kind, |file| file.write_all(text.as_bytes()))
}
