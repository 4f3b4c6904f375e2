//! Solids in scene files.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DQuat, DVec3, DVec4, Vec3};
use serde::{Deserialize, Serialize};

use super::mesh_sequence::MeshSequence;
use super::mesh_source::{MeshSource, Normals};
use super::motion::{self, KeyFile, Motion};
use crate::budget::Budget;
use crate::error::{Error, Result};
use crate::meshes;
use crate::output;
use limpid::environment::Environment;
use limpid::mesh::{Mesh, MeshData, Placement, Texture};
use limpid::scene::{Shape, Solid, Surface};

/// The files of a scene's meshes and textures, so that the scene can be written again.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SolidFiles {
    meshes: Vec<(Arc<Mesh>, MeshSource)>,
    /// The first mesh of each pattern, and its sequence.
    sequences: Vec<(Arc<Mesh>, Arc<MeshSequence>)>,
    textures: Vec<(Arc<Texture>, PathBuf)>,
    /// Data that the scene's text names, and no file holds.
    given: Given,
    /// Contents of the files that the picture does not show.
    pub remarks: Vec<String>,
}

/// Data that a scene's text names like files, but the caller has in memory.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Given {
    /// Meshes by their names in the text.
    pub meshes: Vec<(PathBuf, MeshData)>,
    /// Environment maps by their names in the text.
    pub environments: Vec<(PathBuf, Environment)>,
    /// Textures and backgrounds by their names in the text.
    pub textures: Vec<(PathBuf, Arc<Texture>)>,
    /// The files of a scene of which this one is a variant: their meshes are not read again.
    pub like: Option<Arc<SolidFiles>>,
}

impl Given {
    /// Finds this name among `named`; paths in a scene's text are relative to its folder.
    pub(super) fn find<'a, T>(named: &'a [(PathBuf, T)], path: &Path) -> Option<&'a T> {
        named.iter().find(|(name, _)| path.ends_with(name)).map(|(_, found)| found)
    }
}

impl SolidFiles {
    /// No files yet, and the data that the caller has in memory.
    pub(super) fn with(given: Given) -> Self {
        Self { given, ..Self::default() }
    }

    /// Keeps what the scene has, and no more of another one.
    pub(super) fn complete(&mut self) {
        self.given.like = None;
    }

    pub(super) fn given(&self) -> &Given {
        &self.given
    }

    /// The mesh of a file; solids with the same file, texture and normals share it.
    fn mesh(&mut self, source: MeshSource, budget: &Budget) -> Result<Arc<Mesh>> {
        if let Some((mesh, _)) = self.meshes.iter().find(|(_, known)| *known == source) {
            return Ok(mesh.clone());
        }
        let texture = source.texture.as_deref();
        let texture = texture.map(|texture| self.texture(texture, budget)).transpose()?;
        let of_like = |like: &Self| {
            like.meshes.iter().find(|(_, known)| *known == source).map(|(mesh, _)| mesh.clone())
        };
        if let Some(mesh) = self.given.like.as_deref().and_then(of_like) {
            self.meshes.push((mesh.clone(), source));
            return Ok(mesh);
        }
        if let Some(data) = Given::find(&self.given.meshes, &source.file) {
            let mesh = Arc::new(source.mesh(&source.file, data.clone(), texture.as_ref())?);
            self.meshes.push((mesh.clone(), source));
            return Ok(mesh);
        }
        let loaded = meshes::load_within(&source.file, budget)?;
        self.remarks.extend(loaded.remarks);
        let mesh = Arc::new(source.mesh(&source.file, loaded.data, texture.as_ref())?);
        self.meshes.push((mesh.clone(), source));
        Ok(mesh)
    }

    /// The meshes of a pattern's files, and that of the first.
    fn sequence(
        &mut self,
        source: MeshSource,
        budget: &Budget,
    ) -> Result<(Arc<Mesh>, Arc<MeshSequence>)> {
        let known = self.sequences.iter().find(|(_, known)| known.source == source);
        if let Some((first, sequence)) = known {
            return Ok((first.clone(), sequence.clone()));
        }
        let texture = source.texture.as_deref();
        let texture = texture.map(|texture| self.texture(texture, budget)).transpose()?;
        let (sequence, first, remarks) = MeshSequence::open(source.clone(), texture, budget)?;
        self.remarks.extend(remarks);
        self.meshes.push((first.clone(), source));
        let found = (first, Arc::new(sequence));
        self.sequences.push(found.clone());
        Ok(found)
    }

    pub(super) fn texture(&mut self, file: &Path, budget: &Budget) -> Result<Arc<Texture>> {
        if let Some((texture, _)) = self.textures.iter().find(|(_, known)| known == file) {
            return Ok(texture.clone());
        }
        if let Some(texture) = Given::find(&self.given.textures, file).cloned() {
            self.textures.push((texture.clone(), file.to_owned()));
            return Ok(texture);
        }
        let texture = Arc::new(meshes::texture_within(file, budget)?);
        self.textures.push((texture.clone(), file.to_owned()));
        Ok(texture)
    }

    fn source(&self, mesh: &Arc<Mesh>) -> Option<&MeshSource> {
        self.meshes.iter().find(|(known, _)| Arc::ptr_eq(known, mesh)).map(|(_, source)| source)
    }

    pub(super) fn texture_source(&self, texture: &Arc<Texture>) -> Option<&Path> {
        let known = self.textures.iter().find(|(known, _)| Arc::ptr_eq(known, texture));
        known.map(|(_, file)| file.as_path())
    }

    /// Gives meshes and textures that are in memory alone files beside the scene file at `path`, and returns those with
    /// their contents.
    ///
    /// # Errors
    /// [`Error::Io`] for a texture that cannot be encoded.
    pub(super) fn name_given(&mut self, path: &Path) -> Result<Vec<(PathBuf, Vec<u8>)>> {
        let mut files: Vec<(PathBuf, Vec<u8>)> = Vec::new();
        let mut renamed: Vec<(PathBuf, PathBuf)> = Vec::new();
        for (_, source) in &self.meshes {
            let known = renamed.iter().any(|(given, _)| *given == source.file);
            let data = Given::find(&self.given.meshes, &source.file).filter(|_| !known);
            if let Some(data) = data {
                let file = path.with_extension(format!("mesh-{}.ply", files.len() + 1));
                files.push((file.clone(), meshes::ply(data)));
                renamed.push((source.file.clone(), file));
            }
        }
        let of_meshes = files.len();
        for (texture, given) in &self.textures {
            if Given::find(&self.given.textures, given).is_some() {
                let number = files.len() - of_meshes + 1;
                let file = path.with_extension(format!("texture-{number}.png"));
                files.push((file.clone(), png(&file, texture)?));
                renamed.push((given.clone(), file));
            }
        }
        self.map_paths(|path| {
            let file = renamed.iter().find(|(given, _)| given == path);
            file.map_or_else(|| path.to_owned(), |(_, file)| file.clone())
        });
        Ok(files)
    }

    /// Changes the paths, for a scene file in another folder.
    pub(super) fn map_paths(&mut self, map: impl Fn(&Path) -> PathBuf) {
        for (_, source) in &mut self.meshes {
            source.file = map(&source.file);
            source.texture = source.texture.as_deref().map(&map);
        }
        for (_, file) in &mut self.textures {
            *file = map(file);
        }
    }
}

/// The bytes of a texture's PNG; `path` is for messages.
fn png(path: &Path, texture: &Texture) -> Result<Vec<u8>> {
    let size = texture.size();
    let picture = image::RgbaImage::from_raw(size.x, size.y, texture.pixels().concat());
    let picture = picture.expect("each pixel has four bytes").into();
    let mut bytes = Vec::new();
    output::encode_png(&mut bytes, &picture, &[]).map_err(|e| Error::io(path, "encode", e))?;
    Ok(bytes)
}

#[derive(Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ShapeFile {
    #[default]
    Plane,
    Box,
    Sphere,
    Mesh,
}

/// A `[[solid]]`.
#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SolidFile {
    shape: ShapeFile,
    origin: Option<DVec3>,
    normal: Option<Vec3>,
    half_extent: Option<f32>,
    min: Option<DVec3>,
    max: Option<DVec3>,
    center: Option<DVec3>,
    radius: Option<f32>,
    file: Option<PathBuf>,
    normals: Option<Normals>,
    translate: Option<DVec3>,
    rotate: Option<DVec4>,
    quaternion: Option<DQuat>,
    scale: Option<f64>,
    color: Option<Vec3>,
    #[serde(default)]
    lit: bool,
    texture: Option<PathBuf>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    flip: Option<bool>,
    tile: Option<f32>,
    checker: Option<CheckerFile>,
    ground: Option<GroundFile>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    key: Vec<KeyFile>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CheckerFile {
    tile: f32,
    even: Vec3,
    odd: Vec3,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct GroundFile {
    tile: f32,
    even: Vec3,
    odd: Vec3,
    fade: f32,
}

impl SolidFile {
    /// The table of a solid whose files are known, and which may move.
    ///
    /// # Errors
    /// [`Error::Usage`] for a mesh or texture that was not read from a file.
    pub(super) fn of(solid: &Solid, motion: Option<&Motion>, files: &SolidFiles) -> Result<Self> {
        let unknown = |what: &str| Error::Usage(format!("a {what} needs a file of its own"));
        let keys = motion.map_or(&[][..], |motion| &motion.keys);
        let key = keys.iter().map(|&key| key.into()).collect();
        let mut file = Self { lit: solid.lit, key, ..Self::default() };
        match solid.shape {
            Shape::Plane { origin, normal, half_extent } => {
                file.shape = ShapeFile::Plane;
                (file.origin, file.normal) = (Some(origin), Some(normal));
                file.half_extent = half_extent.is_finite().then_some(half_extent);
            }
            Shape::Box { min, max } => {
                file.shape = ShapeFile::Box;
                (file.min, file.max) = (Some(min), Some(max));
            }
            Shape::Sphere { center, radius } => {
                file.shape = ShapeFile::Sphere;
                (file.center, file.radius) = (Some(center), Some(radius));
            }
            Shape::Mesh { ref mesh, placement: Placement { translate, rotate, scale } } => {
                let source = files.source(mesh).ok_or_else(|| unknown("mesh"))?.clone();
                file.shape = ShapeFile::Mesh;
                (file.file, file.texture) = (Some(source.file), source.texture);
                file.normals = Some(source.normals);
                file.flip = source.flip.then_some(true);
                (file.translate, file.scale) = (Some(translate), Some(scale));
                file.quaternion = Some(rotate);
            }
        }
        match solid.surface {
            Surface::Color(color) => file.color = Some(color),
            Surface::Checker { tile, even, odd } => {
                file.checker = Some(CheckerFile { tile, even, odd });
            }
            Surface::Ground { tile, even, odd, fade } => {
                file.ground = Some(GroundFile { tile, even, odd, fade });
            }
            Surface::Texture { ref texture, tile } => {
                let source = files.texture_source(texture).ok_or_else(|| unknown("texture"))?;
                file.texture = Some(source.to_owned());
                // It covers a sphere once.
                file.tile = (!matches!(solid.shape, Shape::Sphere { .. })).then_some(tile);
            }
            Surface::Own => {}
        }
        Ok(file)
    }

    /// The solid and its motion, with its mesh and textures read from files relative to `folder`, whose memory is taken
    /// of the scene's `budget`. `fail` makes the error of a problem with the table.
    pub(super) fn load(
        self,
        folder: &Path,
        files: &mut SolidFiles,
        budget: &Budget,
        fail: &dyn Fn(String) -> Error,
    ) -> Result<(Solid, Motion)> {
        let name = self.check_keys().map_err(fail)?;
        let turns = matches!(self.shape, ShapeFile::Mesh);
        let keys = motion::keys(&self.key, (!turns).then_some(name)).map_err(fail)?;
        let mut motion = Motion { keys, meshes: None };
        let lit = self.lit;
        let texture = self.texture.as_ref().map(|texture| folder.join(texture));
        let mesh = match &self.file {
            Some(file) => {
                let (file, normals) = (folder.join(file), self.normals.unwrap_or_default());
                let (texture, flip) = (texture.clone(), self.flip.unwrap_or_default());
                let source = MeshSource { file, texture, flip, normals };
                Some(if MeshSequence::is_pattern(&source.file) {
                    let (first, meshes) = files.sequence(source, budget)?;
                    motion.meshes = Some(meshes);
                    first
                } else {
                    files.mesh(source, budget)?
                })
            }
            None => None,
        };
        let shape = self.placed(mesh).map_err(fail)?;
        let texture = match texture.filter(|_| !matches!(shape, Shape::Mesh { .. })) {
            Some(texture) => Some(files.texture(&texture, budget)?),
            None => None,
        };
        let surface = self.surface(&shape, texture).map_err(fail)?;
        Ok((Solid { shape, surface, lit }, motion))
    }

    /// Fails if a key of the table belongs to another shape; returns the shape's name.
    fn check_keys(&self) -> Result<&'static str, String> {
        let (name, takes): (_, &[&str]) = match self.shape {
            ShapeFile::Plane => ("plane", &["origin", "normal", "half_extent", "tile"]),
            ShapeFile::Box => ("box", &["min", "max", "tile"]),
            ShapeFile::Sphere => ("sphere", &["center", "radius"]),
            ShapeFile::Mesh => {
                ("mesh", &["file", "translate", "rotate", "quaternion", "scale", "normals", "flip"])
            }
        };
        let given = [
            ("origin", self.origin.is_some()),
            ("normal", self.normal.is_some()),
            ("half_extent", self.half_extent.is_some()),
            ("min", self.min.is_some()),
            ("max", self.max.is_some()),
            ("center", self.center.is_some()),
            ("radius", self.radius.is_some()),
            ("file", self.file.is_some()),
            ("translate", self.translate.is_some()),
            ("rotate", self.rotate.is_some()),
            ("quaternion", self.quaternion.is_some()),
            ("scale", self.scale.is_some()),
            ("normals", self.normals.is_some()),
            ("flip", self.flip.is_some()),
            ("tile", self.tile.is_some()),
        ];
        match given.iter().find(|(key, given)| *given && !takes.contains(key)) {
            Some((key, _)) => Err(format!("a {name} has no {key}; it takes {}", takes.join(", "))),
            None => Ok(name),
        }
    }

    fn placed(&self, mesh: Option<Arc<Mesh>>) -> Result<Shape, String> {
        fn need<T>(value: Option<T>, shape: &str, key: &str) -> Result<T, String> {
            value.ok_or_else(|| format!("a {shape} needs {key}"))
        }
        Ok(match self.shape {
            ShapeFile::Plane => {
                let normal = self.normal.unwrap_or(Vec3::Y);
                Shape::Plane {
                    origin: need(self.origin, "plane", "origin")?,
                    normal: unit(normal).ok_or("normal must not be zero")?,
                    half_extent: self.half_extent.unwrap_or(f32::INFINITY),
                }
            }
            ShapeFile::Box => {
                let (min, max) = (need(self.min, "box", "min")?, need(self.max, "box", "max")?);
                Shape::Box { min, max }
            }
            ShapeFile::Sphere => Shape::Sphere {
                center: need(self.center, "sphere", "center")?,
                radius: need(self.radius, "sphere", "radius")?,
            },
            ShapeFile::Mesh => Shape::Mesh {
                mesh: need(mesh, "mesh", "file")?,
                placement: Placement {
                    translate: self.translate.unwrap_or_default(),
                    rotate: motion::rotation(self.rotate, self.quaternion)?,
                    scale: self.scale.unwrap_or(1.0),
                },
            },
        })
    }

    fn surface(self, shape: &Shape, texture: Option<Arc<Texture>>) -> Result<Surface, String> {
        if self.tile.is_some() && texture.is_none() {
            return Err("tile is the width of a texture, which is missing".into());
        }
        let is_mesh = matches!(shape, Shape::Mesh { .. });
        let has_texture = self.texture.is_some();
        match (self.color, self.checker, self.ground) {
            (Some(color), None, None) if !has_texture => Ok(Surface::Color(color)),
            (None, Some(CheckerFile { tile, even, odd }), None) if !has_texture => {
                Ok(Surface::Checker { tile, even, odd })
            }
            (None, None, Some(GroundFile { tile, even, odd, fade })) if !has_texture => {
                Ok(Surface::Ground { tile, even, odd, fade })
            }
            (None, None, None) => match (texture, is_mesh) {
                (_, true) => Ok(Surface::Own),
                (None, false) => Ok(Surface::Color(Vec3::splat(0.5))),
                (Some(texture), false) => {
                    let tile = self.tile.or_else(|| natural_tile(shape));
                    let tile = tile.ok_or("an endless plane's texture needs tile, its width")?;
                    Ok(Surface::Texture { texture, tile })
                }
            },
            _ => Err("takes one of color, checker, ground and texture".into()),
        }
    }
}

/// The width at which a texture fills a solid once.
fn natural_tile(shape: &Shape) -> Option<f32> {
    match *shape {
        Shape::Plane { half_extent, .. } => half_extent.is_finite().then_some(2.0 * half_extent),
        Shape::Box { min, max } => Some((max - min).max_element() as f32),
        Shape::Sphere { .. } | Shape::Mesh { .. } => Some(1.0),
    }
}

/// Normalizes a direction; a unit vector is returned unchanged, so that a written one reads back the
/// same.
pub(super) fn unit(direction: Vec3) -> Option<Vec3> {
    /// Error of a unit vector's length by the rounding of three 32-bit floats.
    const ROUNDING: f64 = 2e-7;
    let direction64 = direction.as_dvec3();
    if (direction64.length() - 1.0).abs() < ROUNDING {
        return Some(direction);
    }
    direction64.try_normalize().map(|unit| unit.as_vec3())
}
