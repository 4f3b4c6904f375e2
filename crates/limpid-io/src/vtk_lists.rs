//! Lists of VTK files: pieces that form one data set (`.pvtu`, `.pvtp`, `.vtm`), and time series (`.pvd` of
//! `ParaView`, `.series`).

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::{BytesStart, Event};
use serde::Deserialize;

use crate::error::{Error, Location, Result, printable};

/// Largest number of listed files.
const MOST: usize = 1 << 20;

/// A listed file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Listed {
    /// Its path.
    pub(crate) path: PathBuf,
    /// Its time, if the list has times.
    pub(crate) time: Option<f64>,
}

/// Lists the files of a piece list or a `.pvd`, by the elements `Piece` (with `Source`) and `DataSet` (with
/// `file` and `timestep`); their paths are relative to the list.
///
/// # Errors
/// [`Error::Malformed`] for XML with errors, and [`Error::Format`] for a list without files, of too many or
/// of one file twice.
pub(crate) fn parse_xml(path: &Path, bytes: &[u8]) -> Result<Vec<Listed>> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let blocks = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("vtm"));
    let mut xml = Reader::from_reader(bytes);
    let mut listed = Vec::new();
    let mut open: Vec<String> = Vec::new();
    loop {
        let at = xml.buffer_position();
        let fail = |at: u64, problem: String| Error::malformed(path, Location::Byte(at), problem);
        let event = xml.read_event().map_err(|error| fail(at, format!("not XML: {error}")))?;
        let empty = matches!(event, Event::Empty(_));
        let element = match event {
            Event::Eof => match open.pop() {
                Some(name) => {
                    return Err(fail(at, format!("the list is cut off: <{name}> has no end")));
                }
                None => break,
            },
            Event::Start(element) | Event::Empty(element) => element,
            Event::End(_) => {
                open.pop();
                continue;
            }
            _ => continue,
        };
        if !empty {
            open.push(String::from_utf8_lossy(element.name().as_ref()).into_owned());
        }
        // An entry without its end takes the next one for its attributes.
        if let Some(Err(error)) = element.attributes().find(std::result::Result::is_err) {
            return Err(fail(at, format!("not XML: {error}")));
        }
        let attribute = |name: &str| attribute(&element, name).map_err(|problem| fail(at, problem));
        let key = match element.local_name().as_ref() {
            b"Piece" => "Source",
            b"DataSet" => "file",
            other => {
                if attribute("Source")?.or(attribute("file")?).is_some() {
                    let other = printable(String::from_utf8_lossy(other).into_owned());
                    let problem = format!("<{other}> names a file; expected a Piece or a DataSet");
                    return Err(fail(at, problem));
                }
                continue;
            }
        };
        let Some(file) = attribute(key)?.filter(|file| !file.is_empty()) else {
            // Blocks may be empty.
            if blocks {
                continue;
            }
            return Err(fail(at, format!("an entry without the attribute {key}")));
        };
        let time = attribute("timestep")?.and_then(|text| text.parse::<f64>().ok());
        listed.push(Listed { path: folder.join(file), time });
        if listed.len() > MOST {
            return Err(Error::format(path, format!("more than {MOST} files")));
        }
    }
    checked(path, listed)
}

/// The text of an element's attribute, in which entities are replaced by what they stand for. An ampersand that begins
/// none stands for itself, as some programs write names of files.
pub(crate) fn attribute(element: &BytesStart<'_>, name: &str) -> Result<Option<String>, String> {
    let found = element.try_get_attribute(name).map_err(|error| error.to_string())?;
    Ok(found.map(|attribute| {
        let text = String::from_utf8_lossy(&attribute.value);
        let text = unescape(&text).unwrap_or_else(|_| text.as_ref().into());
        text.trim().to_owned()
    }))
}

/// Lists the files of a `.series`: JSON with the name and the time of each.
///
/// # Errors
/// As [`parse_xml`].
pub(crate) fn parse_series(path: &Path, bytes: &[u8]) -> Result<Vec<Listed>> {
    #[derive(Deserialize)]
    struct Series {
        files: Vec<File>,
    }
    #[derive(Deserialize)]
    struct File {
        name: String,
        time: Option<f64>,
    }
    let series: Series = serde_json::from_slice(bytes).map_err(|error| {
        let line = Location::Line(error.line() as u64);
        Error::malformed(path, line, format!("not a list of files: {error}"))
    })?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let file = |file: File| Listed { path: folder.join(file.name), time: file.time };
    checked(path, series.files.into_iter().map(file).collect())
}

fn checked(path: &Path, listed: Vec<Listed>) -> Result<Vec<Listed>> {
    if listed.is_empty() {
        return Err(Error::format(path, "the list names no files"));
    }
    let mut names = BTreeSet::new();
    match listed.iter().find(|file| !names.insert(&file.path)) {
        Some(twice) => {
            Err(Error::format(path, format!("{} is listed twice", twice.path.display())))
        }
        None => Ok(listed),
    }
}

/// Frames per second of times that have one distance, within a thousandth.
pub(crate) fn rate(times: &[f64]) -> Option<f64> {
    let (first, last) = (*times.first()?, *times.last()?);
    let step = (last - first) / (times.len().checked_sub(1).filter(|&n| n > 0)? as f64);
    let even = |pair: &[f64; 2]| ((pair[1] - pair[0]) - step).abs() <= 1e-3 * step;
    let rate = step.recip();
    (step > 0.0 && times.array_windows().all(even) && (0.01..=1e5).contains(&rate)).then_some(rate)
}
