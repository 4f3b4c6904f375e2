//! The scene of a site, and copies of all files that it names.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use limpid_io::input::files_of;
use limpid_io::output::OutputNames;
use limpid_io::particles::readable_stem;
use limpid_io::project::Project;
use limpid_io::sequence::{Frame, Sequence};
use limpid_io::{Error, Result};

use super::site::Site;
use crate::terminal;

/// The scene file of a site.
pub(super) const SCENE: &str = "scene.toml";

/// The file with the names of a folder's files, for servers that list none.
const LIST: &str = "files.txt";

/// Puts a scene into a site, with these frames of its particles and its whitewater, and the files of its solids.
///
/// # Errors
/// As [`Project::to_files`], [`Sequence::open`] and [`Site::copy`]; [`Error::Usage`] for what a site cannot have.
pub(super) fn add(site: &mut Site, project: &Project, numbers: &[i64]) -> Result<()> {
    let path = site.path(SCENE);
    let mut files = project.to_files(&path)?;
    let (_, text) = files.pop().expect("the scene is the last of its files");
    for (path, bytes) in files {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        site.write(&name, &bytes)?;
    }
    let fail = |e: &dyn std::fmt::Display| Error::Usage(format!("the scene: {e}"));
    let text = String::from_utf8(text).map_err(|e| fail(&e))?;
    let mut scene: toml::Table = text.parse().map_err(|e| fail(&e))?;
    if scene.contains_key("rigid_bodies") {
        let problem = "a site cannot have [rigid_bodies], whose files name others: give their meshes as [[solid]]";
        return Err(Error::Usage(problem.into()));
    }
    let numbers: BTreeSet<i64> = numbers.iter().copied().collect();
    for (i, particles) in tables_of(&mut scene, &["particles", "fluid"]).into_iter().enumerate() {
        let folder = if i == 0 { "frames".to_owned() } else { format!("frames-{}", i + 1) };
        if let Some(source) = particles.get_mut("source") {
            let copied = copy_sequence(site, &path_of(source), &folder, Some(&numbers))?;
            *source = copied.into();
        }
    }
    for (i, table) in tables_of(&mut scene, &["diffuse"]).into_iter().enumerate() {
        let source = table.get_mut("source").expect("a table of whitewater has a source");
        *source = copy_whitewater(site, &path_of(source), i + 1, &numbers)?.into();
    }
    let mut known: BTreeMap<PathBuf, String> = BTreeMap::new();
    for solid in tables_of(&mut scene, &["solid", "background"]) {
        for key in ["file", "texture"] {
            let Some(value) = solid.get_mut(key) else { continue };
            let path = path_of(value);
            // Those without a folder have been written above.
            if !path.is_absolute() {
                continue;
            }
            if !known.contains_key(&path) {
                let copied = copy_file(site, &path, known.len() + 1)?;
                known.insert(path.clone(), copied);
            }
            *value = known[&path].clone().into();
        }
    }
    let text = toml::to_string(&scene).map_err(|e| fail(&e))?;
    let text = format!("# The scene of this site; `limpid render {SCENE}` draws it too.\n\n{text}");
    site.write(SCENE, text.as_bytes())
}

/// The tables with these names, alone or in lists.
fn tables_of<'a>(scene: &'a mut toml::Table, names: &[&str]) -> Vec<&'a mut toml::Table> {
    let mut tables = Vec::new();
    for (name, value) in scene.iter_mut() {
        match value {
            _ if !names.contains(&name.as_str()) => {}
            toml::Value::Array(all) => {
                tables.extend(all.iter_mut().filter_map(toml::Value::as_table_mut));
            }
            value => tables.extend(value.as_table_mut()),
        }
    }
    tables
}

fn path_of(value: &toml::Value) -> PathBuf {
    value.as_str().unwrap_or_default().into()
}

/// Copies the file of a solid, or the files of its pattern; returns its name for the scene.
fn copy_file(site: &mut Site, path: &Path, number: usize) -> Result<String> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if extension == "gltf" {
        let path = path.display();
        let problem =
            format!("{path}: a site cannot have a .gltf, which names other files: save it as .glb");
        return Err(Error::Usage(problem));
    }
    if !path.is_file() {
        return copy_sequence(site, path, &format!("solids/{number}"), None);
    }
    let name = format!("solids/{number}.{extension}");
    site.copy(path, &name)?;
    Ok(name)
}

/// Copies the files of whitewater with these numbers, or one file, which belongs to the frame that the scene selects; returns
/// their name for the scene.
fn copy_whitewater(
    site: &mut Site,
    path: &Path,
    number: usize,
    numbers: &BTreeSet<i64>,
) -> Result<String> {
    let name = format!("whitewater-{number}");
    match Sequence::open(path)?.frames.as_slice() {
        [frame] if path.is_file() => {
            let ending = ending(&frame.path)?;
            let name = format!("{name}{ending}");
            copy_frame(site, frame, &name, &ending)?;
            Ok(name)
        }
        // All frames in one file.
        [first, ..] if first.section.is_some() => copy_sequence(site, path, &name, None),
        _ => copy_sequence(site, path, &name, Some(numbers)),
    }
}

/// Copies the frames of a sequence with these numbers, or all, into a folder with a list of them; returns its pattern
/// there, or the file that has them all.
fn copy_sequence(
    site: &mut Site,
    source: &Path,
    folder: &str,
    numbers: Option<&BTreeSet<i64>>,
) -> Result<String> {
    let sequence = Sequence::open(source)?;
    let is_wanted = |number: i64| numbers.is_none_or(|numbers| numbers.contains(&number));
    let frames: Vec<_> = sequence.frames.iter().filter(|frame| is_wanted(frame.number)).collect();
    let first = &sequence.frames[0];
    let ending = ending(&first.path)?;
    if first.section.is_some() {
        if frames.len() < sequence.frames.len() {
            let source = source.display();
            let problem = format!(
                "--frames: {source} has all frames in one file; `limpid convert` writes some of them"
            );
            return Err(Error::Usage(problem));
        }
        let name = format!("{folder}/frames{ending}");
        site.copy(&first.path, &name)?;
        return Ok(name);
    }
    let names = OutputNames::parse(Path::new(folder).join(format!("frame_####{ending}")), 2)?;
    let mut list = String::new();
    let bar = terminal::progress(frames.len());
    for frame in frames {
        let name = names.path(frame.number).to_string_lossy().into_owned();
        let copied = copy_frame(site, frame, &name, &ending);
        copied.inspect_err(|_| bar.finish_and_clear())?;
        list += &format!("{}\n", name.rsplit('/').next().unwrap_or(&name));
        bar.inc(1);
    }
    bar.finish_and_clear();
    site.write(&format!("{folder}/{LIST}"), list.as_bytes())?;
    Ok(format!("{folder}/frame_{{}}{ending}"))
}

/// Copies the file of a frame, and ellipsoids beside it.
fn copy_frame(site: &mut Site, frame: &Frame, name: &str, ending: &str) -> Result<()> {
    let path = &frame.path;
    let others: Vec<PathBuf> = files_of(path).into_iter().filter(|other| other != path).collect();
    let ellipsoids = path.with_extension("ani");
    let is_alone = frame.parts.is_empty() && others.iter().all(|other| *other == ellipsoids);
    if !is_alone || self::ending(path)? != ending {
        let path = path.display();
        let problem = format!(
            "{path}: a frame of a site is one file, of the same format as the others; `limpid convert INPUT frames/` \
             writes such files"
        );
        return Err(Error::Usage(problem));
    }
    if !others.is_empty() && ellipsoids.exists() {
        site.copy(&ellipsoids, &Path::new(name).with_extension("ani").to_string_lossy())?;
    }
    site.copy(path, name)
}

/// The end of a file's name from which its format is known, as `.csv.gz`.
fn ending(path: &Path) -> Result<String> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let stem =
        readable_stem(&name).or(Path::new(&*name).file_stem().and_then(|stem| stem.to_str()));
    let ending = &name[stem.map_or(name.len(), str::len)..];
    if ending.trim_start_matches('.').bytes().any(|byte| byte.is_ascii_alphabetic()) {
        return Ok(ending.to_ascii_lowercase());
    }
    let path = path.display();
    let problem = format!(
        "{path}: a server's file needs a name with its format; `limpid convert` writes others"
    );
    Err(Error::Usage(problem))
}
