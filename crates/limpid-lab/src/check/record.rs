//! The record of how the expected pictures were rendered: `blessed.toml` next to them.

use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::{Adapter, write_file};
use limpid_io::error::{Result, toml_error};
use limpid_io::files;
use limpid_io::output::FileKind;

const HEADER: &str = "# What `limpid check --bless` drew the expected pictures with.\n";

/// The record of a suite: one table per blessed entry.
pub(super) struct Record {
    path: PathBuf,
    entries: Table,
}

impl Record {
    /// Reads the record of a suite; empty if the file does not exist.
    pub(super) fn open(suite: &Path) -> Result<Self> {
        let path = suite.with_extension("").join("blessed.toml");
        let text = if path.exists() { files::read_text(&path)? } else { String::new() };
        let origin = path.display().to_string();
        let entries = text.parse().map_err(|e| toml_error(&text, &origin, &e))?;
        Ok(Self { path, entries })
    }

    /// Records the adapter and the settings that an entry was rendered with.
    pub(super) fn note(&mut self, name: &str, adapter: &Adapter, drawn: &Table) {
        let texts = [
            ("limpid", env!("CARGO_PKG_VERSION")),
            ("adapter", &adapter.name),
            ("driver", &adapter.driver),
            ("backend", &adapter.backend),
        ];
        let texts = texts.map(|(key, text)| (key.to_owned(), Value::from(text)));
        let all = texts.into_iter().chain(drawn.clone()).collect();
        self.entries.insert(name.to_owned(), Value::Table(all));
    }

    pub(super) fn write(&self) -> Result<()> {
        let mut text = HEADER.to_owned();
        for (name, entry) in &self.entries {
            // Names may contain dots.
            text += &format!("\n[{}]\n", Value::from(name.as_str()));
            // One line per key, tables included: a change shows up as a changed line.
            for (key, value) in entry.as_table().into_iter().flatten() {
                text += &format!("{key} = {value}\n");
            }
        }
        write_file(&self.path, FileKind::BLESS_RECORD, text.as_bytes())
    }
}
