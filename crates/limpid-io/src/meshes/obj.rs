//! Wavefront OBJ and MTL (Wavefront Technologies, "Advanced Visualizer Manual", 1993, appendix B1; Diane
//! Ramey, Linda Rose and Lisa Tyerman, "MTL material format", 1995): polygons with normals and texture
//! coordinates, of which the second grows upwards, and materials with `Kd`, linear, and `map_Kd`.
//!
//! Lines, points, curves and surfaces are left out, groups and smoothing groups are not used.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use glam::{DVec2, DVec3, Vec2, Vec3};
use limpid::memory;
use limpid::mesh::Material;

use super::{Builder, Vertex};
use crate::error::{Error, Result};
use crate::files;
use crate::particles::cursor::Cursor;

// Our own, not the crate `tobj` (4.0): it panics on a `Kd` of fewer than three numbers, overflows on large
// indices, and its errors have no lines.
pub(super) fn read(path: &Path, bytes: &[u8], mesh: &mut Builder<'_>) -> Result<()> {
    let mut reader = Reader {
        file: Cursor::new(path, bytes, true),
        mesh,
        positions: Vec::new(),
        coordinates: Vec::new(),
        normals: Vec::new(),
        corners: HashMap::new(),
        library_lines: HashSet::new(),
        libraries: HashSet::new(),
        materials: HashMap::new(),
        used: HashMap::new(),
        material: None,
    };
    while let Some(line) = reader.statement() {
        reader.read_statement(&line)?;
    }
    Ok(())
}

/// A material of an MTL file.
#[derive(Clone, Default)]
struct Description {
    color: Option<Vec3>,
    /// Name of the texture's file.
    texture: Option<String>,
    is_transparent: bool,
}

struct Reader<'a, 'm, 'b> {
    file: Cursor<'a>,
    mesh: &'m mut Builder<'b>,
    positions: Vec<DVec3>,
    coordinates: Vec<Vec2>,
    normals: Vec<Vec3>,
    /// Vertices by the indices of their positions, coordinates and normals.
    corners: HashMap<[Option<u32>; 3], u32>,
    /// The `mtllib` lines so far, and their files.
    library_lines: HashSet<String>,
    libraries: HashSet<PathBuf>,
    /// Their materials.
    materials: HashMap<String, Description>,
    /// Indices of the used materials by name; faces before the first have none.
    used: HashMap<Option<String>, u32>,
    /// Name of the current material.
    material: Option<String>,
}

impl<'a> Reader<'a, '_, '_> {
    /// The next line, with those that continue it after a backslash.
    fn statement(&mut self) -> Option<Cow<'a, str>> {
        let mut line = self.file.line()?;
        let start = self.file.start;
        while line.ends_with('\\') {
            let Some(next) = self.file.line() else { break };
            // Appended, as copies of all lines so far would take quadratic time.
            let joined = line.to_mut();
            joined.pop();
            joined.push(' ');
            joined.push_str(&next);
        }
        self.file.start = start;
        Some(line)
    }

    fn read_statement(&mut self, line: &str) -> Result<()> {
        let line = line.trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        match keyword {
            "v" => {
                let position = self.numbers(rest, 3)?.into();
                push(&mut self.positions, position, self.mesh)?;
            }
            "vt" => {
                // The second number may be left out.
                let [u, v, _] = self.numbers(rest, 1)?;
                let coordinates = DVec2::new(u, 1.0 - v).as_vec2();
                push(&mut self.coordinates, coordinates, self.mesh)?;
            }
            "vn" => {
                let normal = DVec3::from(self.numbers(rest, 3)?).as_vec3();
                push(&mut self.normals, normal, self.mesh)?;
            }
            "f" | "fo" => self.face(rest)?,
            "mtllib" if self.library_lines.insert(rest.trim().to_owned()) => {
                self.library(rest.trim())?;
            }
            "usemtl" => self.material = Some(rest.trim().to_owned()),
            _ => {}
        }
        Ok(())
    }

    /// Up to three numbers, at least `least`; 0 for those left out.
    fn numbers(&self, text: &str, least: usize) -> Result<[f64; 3]> {
        let mut numbers = [0.0; 3];
        let mut words = text.split_ascii_whitespace();
        for (i, number) in numbers.iter_mut().enumerate() {
            match words.next() {
                Some(word) => *number = self.file.number(word)?,
                None if i < least => {
                    return Err(self.file.error(format!("{i} numbers, expected {least}")));
                }
                None => break,
            }
        }
        Ok(numbers)
    }

    fn face(&mut self, text: &str) -> Result<()> {
        let mut corners = Vec::new();
        for word in text.split_ascii_whitespace() {
            corners.push(self.corner(word)?);
        }
        if corners.len() < 3 {
            let corners = corners.len();
            return Err(self
                .file
                .error(format!("a face of {corners} corners; expected at least 3")));
        }
        let material = self.current_material()?;
        self.mesh.polygon(&corners, material)
    }

    /// The vertex of a corner such as `7`, `7/2`, `7//3` or `7/2/3`.
    fn corner(&mut self, word: &str) -> Result<u32> {
        let counts = [self.positions.len(), self.coordinates.len(), self.normals.len()];
        let mut key = [None; 3];
        let mut parts = word.split('/');
        for ((index, count), what) in
            key.iter_mut().zip(counts).zip(["vertex", "texture vertex", "normal"])
        {
            match parts.next() {
                Some("") | None => {}
                Some(part) => *index = Some(self.index(part, count, what)?),
            }
        }
        let [Some(position), coordinates, normal] = key else {
            return Err(self.file.error(format!("expected a corner, found `{word}`")));
        };
        if parts.next().is_some() {
            return Err(self.file.error(format!("expected at most v/vt/vn, found `{word}`")));
        }
        if let Some(&vertex) = self.corners.get(&key) {
            return Ok(vertex);
        }
        self.mesh.has_coordinates |= coordinates.is_some();
        self.mesh.has_normals |= normal.is_some();
        let vertex = Vertex {
            position: self.positions[position as usize],
            coordinates: coordinates.map_or(Vec2::ZERO, |i| self.coordinates[i as usize]),
            normal: normal.map_or(Vec3::ZERO, |i| self.normals[i as usize]),
        };
        let vertex = self.mesh.vertex(vertex, |problem| self.file.error(problem))?;
        self.corners.insert(key, vertex);
        Ok(vertex)
    }

    /// The index, from 0, that a number of a corner means: from 1, or backwards from the last one.
    fn index(&self, word: &str, count: usize, what: &str) -> Result<u32> {
        let number: i64 = word.parse().map_err(|_| {
            self.file.error(format!("expected the number of a {what}, found `{word}`"))
        })?;
        let index =
            if number < 0 { number.checked_add_unsigned(count as u64) } else { Some(number - 1) };
        let index = index.and_then(|index| u32::try_from(index).ok());
        index.filter(|&index| (index as usize) < count).ok_or_else(|| {
            self.file
                .error(format!("there is no {what} {number}: there are {count} before this line"))
        })
    }

    /// The index of the current material, whose texture is read when it is first used.
    fn current_material(&mut self) -> Result<u32> {
        if let Some(&index) = self.used.get(&self.material) {
            return Ok(index);
        }
        let described = self.material.as_ref().and_then(|name| self.materials.get(name)).cloned();
        if let (Some(name), None) = (&self.material, &described) {
            self.mesh
                .remark(&format!("the material `{name}` is not described; its faces are grey"));
        }
        let Description { color, texture, is_transparent } = described.unwrap_or_default();
        if is_transparent {
            self.mesh.remark_opaque("`d`, `Tr` or `map_d`");
        }
        let texture = match texture {
            Some(name) => {
                let path = self.mesh.beside(&name);
                self.mesh.texture(&path)?
            }
            None => None,
        };
        let default = if texture.is_some() { Vec3::ONE } else { Material::default().color };
        let material = Material { color: color.unwrap_or(default), texture };
        let index = self.mesh.material(material, |problem| self.file.error(problem))?;
        self.used.insert(self.material.clone(), index);
        Ok(index)
    }

    /// Reads the MTL files of a line. A name may contain blanks, or there may be several.
    fn library(&mut self, names: &str) -> Result<()> {
        /// Largest number of files, each of which takes time, even if it does not exist.
        const MOST: usize = 1000;
        let whole = files::is_file(&self.mesh.beside(names));
        let names = if whole { vec![names] } else { names.split_ascii_whitespace().collect() };
        for name in names {
            let path = self.mesh.beside(name);
            // A file that has several names is read once.
            let path = path.canonicalize().unwrap_or(path);
            if !self.libraries.insert(path.clone()) {
                continue;
            }
            if self.libraries.len() > MOST {
                return Err(self.file.error(format!("more than {MOST} material files")));
            }
            let mut bytes = Vec::new();
            match files::read(&path, |_| MTL_LIMIT, &mut bytes) {
                Ok(()) => self.descriptions(&path, &bytes),
                Err(error @ Error::Render(_)) => return Err(error),
                Err(error) => self.mesh.note(format!("{error}; its materials are grey")),
            }
        }
        Ok(())
    }

    /// Reads the materials of an MTL file.
    fn descriptions(&mut self, path: &Path, bytes: &[u8]) {
        let mut file = Cursor::new(path, bytes, true);
        let mut current = None;
        while let Some(line) = file.line() {
            let line = line.trim();
            let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
            let rest = rest.trim();
            if keyword == "newmtl" {
                self.materials.insert(rest.to_owned(), Description::default());
                current = Some(rest.to_owned());
                continue;
            }
            let Some(material) = current.as_ref().and_then(|name| self.materials.get_mut(name))
            else {
                continue;
            };
            match keyword {
                "Kd" => match color(rest) {
                    Some(color) => material.color = Some(color),
                    None => {
                        let problem =
                            format!("`Kd {rest}` is no colour of numbers; it is not used");
                        self.mesh.note(file.error(problem).to_string());
                    }
                },
                "map_Kd" => {
                    let (name, options) = without_options(rest);
                    material.texture = Some(name.to_owned());
                    if options {
                        let problem = "the options of `map_Kd` are not used";
                        self.mesh.note(file.error(problem).to_string());
                    }
                }
                // Opacity, and its opposite.
                "d" => material.is_transparent |= opacity(rest) < 1.0,
                // Some write 1 for opaque materials.
                "Tr" => material.is_transparent |= (0.001..0.999).contains(&opacity(rest)),
                "map_d" => material.is_transparent = true,
                _ => {}
            }
        }
    }
}

/// The last number of a `d` or `Tr`, which may begin with `-halo`; without one, the material is taken to be opaque.
fn opacity(text: &str) -> f64 {
    text.split_ascii_whitespace().next_back().and_then(|word| word.parse().ok()).unwrap_or(1.0)
}

/// Largest size of MTL files, bytes.
const MTL_LIMIT: u64 = 64 << 20;

fn push<T>(values: &mut Vec<T>, value: T, mesh: &Builder<'_>) -> Result<()> {
    memory::grow(values, 1, mesh.path.display())?;
    values.push(value);
    Ok(())
}

/// The colour of a `Kd`: red, green and blue; the last two are the first if they are left out.
fn color(text: &str) -> Option<Vec3> {
    let numbers: Vec<f32> =
        text.split_ascii_whitespace().map(|word| word.parse().ok()).collect::<Option<_>>()?;
    match *numbers {
        [grey] => Some(Vec3::splat(grey)),
        [r, g, b, ..] => Some(Vec3::new(r, g, b)),
        _ => None,
    }
}

/// The file of a `map_Kd`, which may contain blanks, and whether options precede it.
fn without_options(text: &str) -> (&str, bool) {
    let after_word = |text: &'_ str| text.find(char::is_whitespace).unwrap_or(text.len());
    let mut rest = text;
    while rest.starts_with('-') {
        let (option, after) = rest.split_at(after_word(rest));
        rest = after.trim_start();
        let most = match option {
            "-o" | "-s" | "-t" => 3,
            "-mm" => 2,
            _ => 1,
        };
        for k in 0..most {
            let (word, after) = rest.split_at(after_word(rest));
            // Of the first three, only one number is required.
            if k > 0 && word.parse::<f64>().is_err() {
                break;
            }
            rest = after.trim_start();
        }
    }
    (rest, rest.len() < text.len())
}
