//! The list of the sources that were opened last, in the user's cache folder.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use limpid_io::error::Result;
use limpid_io::output::{self, FileKind};
use limpid_io::{error::Error, files};

/// Most sources that are listed.
const MOST: usize = 8;

/// The sources that were opened last.
#[derive(Debug, Default)]
pub(crate) struct Recent {
    /// The file of the list; none keeps it in memory alone.
    file: Option<PathBuf>,
    /// Files, patterns and folders, the last one first.
    inputs: Vec<String>,
}

impl Recent {
    /// The list in a file: a JSON array. A missing or damaged file is an empty list.
    pub(crate) fn load(file: Option<PathBuf>) -> Self {
        let text = file.as_deref().and_then(|path| files::read_text(path).ok());
        let inputs = text.and_then(|text| serde_json::from_str::<Vec<String>>(&text).ok());
        let mut inputs = inputs.unwrap_or_default();
        inputs.truncate(MOST);
        Self { file, inputs }
    }

    /// The sources with their names, the last one first: of equal names, with as much of their folders as tells them apart.
    pub(crate) fn named(&self) -> Vec<(String, &str)> {
        let parts = |input: &str, count: usize| -> String {
            let all: Vec<&str> = input.split(['/', '\\']).filter(|part| !part.is_empty()).collect();
            all[all.len().saturating_sub(count)..].join("/")
        };
        let name = |input: &String| {
            let others = || self.inputs.iter().filter(|other| *other != input);
            let is_alone =
                |name: &String, count| others().all(|other| parts(other, count) != *name);
            let names = (1..=input.len()).map(|count| (parts(input, count), count));
            let found = names.take_while(|(name, _)| name.len() < input.len());
            let mut found = found.filter(|(name, count)| is_alone(name, *count));
            found.next().map_or_else(|| input.clone(), |(name, _)| name)
        };
        self.inputs.iter().map(|input| (name(input), input.as_str())).collect()
    }

    /// Puts a source first, and returns a function that writes the list.
    pub(crate) fn add(
        &mut self,
        input: &str,
    ) -> Option<impl FnOnce() -> Result<()> + Send + use<>> {
        // The next start may be in another folder.
        let input = std::path::absolute(input)
            .map_or_else(|_| input.to_owned(), |path| path.to_string_lossy().into_owned());
        self.inputs.retain(|other| *other != input);
        self.inputs.insert(0, input);
        self.inputs.truncate(MOST);
        let (file, inputs) = (self.file.clone()?, self.inputs.clone());
        Some(move || write(&file, &inputs))
    }
}

fn write(file: &Path, inputs: &[String]) -> Result<()> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
    }
    let text = serde_json::to_string_pretty(inputs).unwrap_or_default();
    output::write_atomically(file, FileKind::CACHE, |out| out.write_all(text.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equal names are told apart by their folders, and no other is longer than it need be.
    #[test]
    fn equal_names_tell_their_folders() {
        let inputs =
            ["/a/run1/out/w_{}.bgeo", "/a/run2/out/w_{}.bgeo", "/b/vase.toml", "w", "https://x/y/"];
        let recent = Recent { file: None, inputs: inputs.map(str::to_owned).to_vec() };
        let names: Vec<String> = recent.named().into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["run1/out/w_{}.bgeo", "run2/out/w_{}.bgeo", "vase.toml", "w", "y"]);
    }
}
