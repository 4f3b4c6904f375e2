//! Companions of a sequence: foam, spray, bubbles and dust in files beside it, by their names.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use limpid::diffuse::DiffuseKind;

use super::names::{file_name, file_names, split_number};
use crate::identity::folder_of;
use crate::particles::readable_stem;

/// Words in the names of such files, and the kind of their particles if they have none of their own. `ppSnd` are
/// mantaflow's secondary particles.
const WORDS: [(&str, DiffuseKind); 9] = [
    ("foam", DiffuseKind::Foam),
    ("spray", DiffuseKind::Spray),
    ("bubble", DiffuseKind::Bubble),
    ("bubbles", DiffuseKind::Bubble),
    ("dust", DiffuseKind::Dust),
    ("diffuse", DiffuseKind::Foam),
    ("whitewater", DiffuseKind::Foam),
    ("ppsnd", DiffuseKind::Foam),
    ("secondary", DiffuseKind::Foam),
];

/// The words of a file's name in lower case, without the extension, with `#` for the number.
fn words(name: &str) -> Vec<String> {
    let stem = |name: &str| readable_stem(name).unwrap_or(name).to_ascii_lowercase();
    let (before, number, after) = match split_number(name) {
        Some((before, _, after)) => {
            (before.to_ascii_lowercase(), vec!["#".to_owned()], stem(after))
        }
        None => (stem(name), Vec::new(), String::new()),
    };
    let parts = |text: &str| -> Vec<String> {
        let parts = text.split(|c: char| !c.is_alphanumeric()).filter(|part| !part.is_empty());
        parts.map(str::to_owned).collect()
    };
    [parts(&before), number, parts(&after)].concat()
}

/// The kind that a name tells, and its other words; `None` for liquid.
fn told(name: &str) -> Option<(DiffuseKind, Vec<String>)> {
    let mut words = words(name);
    let kind_of =
        |word: &String| WORDS.iter().find(|(known, _)| known == word).map(|(_, kind)| *kind);
    let kind = words.iter().rev().find_map(kind_of)?;
    words.retain(|word| kind_of(word).is_none());
    Some((kind, words))
}

/// The names of liquid, if there are some; otherwise all.
pub(super) fn liquid_among(names: &[String]) -> Vec<String> {
    let liquid: Vec<String> = names.iter().filter(|name| told(name).is_none()).cloned().collect();
    if liquid.is_empty() { names.to_vec() } else { liquid }
}

/// The foam, spray, bubbles and dust in files beside a frame of liquid, as patterns or files without a number, with the kinds that
/// their names tell: those whose names have such a word, and otherwise the words of the liquid's, as `water_foam_{}` or
/// `water_{}_foam` beside `water_{}`; or no others; or any, where the folder holds no other liquid. None, if the file is one
/// of such particles itself.
pub(crate) fn companions_of(file: &Path) -> Vec<(PathBuf, DiffuseKind)> {
    let (own, folder) = (file_name(file), folder_of(file));
    // Servers list no folders.
    let Ok(names) = file_names(folder) else { return Vec::new() };
    if told(&own).is_some() {
        return Vec::new();
    }
    let own = words(&own);
    let readable = || names.iter().filter(|name| readable_stem(name).is_some());
    let alone = readable().all(|name| told(name).is_some() || words(name) == own);
    let mut found = BTreeMap::new();
    for name in readable() {
        let Some((kind, others)) = told(name) else { continue };
        if alone || others == own || others.iter().all(|word| word == "#") {
            let stem = match split_number(name) {
                Some((before, _, after)) => format!("{before}{{}}{after}"),
                None => name.clone(),
            };
            found.entry(stem).or_insert(kind);
        }
    }
    found.into_iter().map(|(stem, kind)| (folder.join(stem), kind)).collect()
}
