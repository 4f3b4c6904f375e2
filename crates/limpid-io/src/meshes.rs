//! Readers of triangle meshes, for solids of any shape.
//!
//! Each format has its own module. They share a `Builder`, which collects vertices and triangles, and
//! the `Cursor` of the particle readers, which never reads beyond the file. Counts in files are checked
//! against the remaining bytes before anything is allocated.

mod gltf;
mod obj;
mod ply;
pub mod rigid_bodies;
mod stl;

pub(crate) use ply::write as ply;

use std::collections::HashMap;
use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, UVec2, Vec2, Vec3};
use image::{ImageError, ImageFormat, ImageReader};
use limpid::camera::is_position;
use limpid::environment::is_radiance;
use limpid::memory;
use limpid::mesh::{Material, MeshData, Texture};

use crate::budget::Budget;
use crate::error::{Error, Location, Result};
use crate::files;

/// Extensions of files that [`load`] reads, in lower case.
pub const EXTENSIONS: [&str; 5] = ["glb", "gltf", "obj", "ply", "stl"];

/// A mesh of a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LoadedMesh {
    /// The mesh: at least one triangle, whose corners exist; positions, normals, texture coordinates and
    /// colours within the ranges of [`limpid::mesh::Mesh`].
    pub data: MeshData,
    /// Contents of the file that the mesh does not show: a missing texture, say. One sentence
    /// each, with the file's name.
    pub remarks: Vec<String>,
}

/// Reads a mesh. The extension, in any case, selects the format:
///
/// | extension | format | what is read |
/// |---|---|---|
/// | `.gltf`, `.glb` | glTF 2.0 | the nodes of all scenes at rest; normals, base colours and their textures |
/// | `.obj` | Wavefront OBJ | polygons, normals, texture coordinates; `Kd` and `map_Kd` of the MTL files beside it |
/// | `.ply` | PLY, ASCII or binary of either byte order | polygons, normals, texture coordinates, the `TextureFile` of a comment |
/// | `.stl` | STL, ASCII or binary | triangles; equal corners become one vertex |
///
/// Positions are in the file's own unit and axes; nothing is scaled or turned. Polygons become fans of
/// triangles, so they should be convex. Files beside the mesh, such as textures, are read too; a material
/// or texture that cannot be read is a remark.
///
/// # Errors
///
/// [`Error::Io`] if the file cannot be read; [`Error::Format`] if it has another format, no triangles, or
/// features that are not read; [`Error::Malformed`], with the place, if it violates its format, has an
/// index out of range or a number that is not finite.
///
/// [`Error::TooLarge`] if mesh and textures take more memory than the length of their files warrants.
pub fn load(path: &Path) -> Result<LoadedMesh> {
    load_within(path, &Budget::of_meshes())
}

/// As [`load`], for a mesh of the document with this budget.
pub(crate) fn load_within(path: &Path, budget: &Budget) -> Result<LoadedMesh> {
    let extension = path.extension().and_then(OsStr::to_str).unwrap_or("").to_ascii_lowercase();
    let read = match extension.as_str() {
        "glb" | "gltf" => gltf::read,
        "obj" => obj::read,
        "ply" => ply::read,
        "stl" => stl::read,
        _ => {
            let known = EXTENSIONS.map(|extension| format!(".{extension}")).join(", ");
            let problem = format!("not a kind of mesh that limpid knows; can be read: {known}");
            return Err(Error::format(path, problem));
        }
    };
    let mut bytes = Vec::new();
    files::read(path, |_| u64::MAX, &mut bytes)?;
    budget.add_file(path, bytes.len() as u64);
    let mut builder = Builder::new(path, budget);
    read(path, &bytes, &mut builder)?;
    builder.finish()
}

/// Reads a texture: PNG, JPEG or WebP, of which the contents decide. Colours are taken as sRGB; 16-bit ones
/// are rounded to 8 bits.
///
/// # Errors
///
/// [`Error::Io`] or [`Error::Format`] naming the file; [`limpid::Error::Memory`] if the pixels do not fit.
pub fn texture(path: &Path) -> Result<Texture> {
    texture_within(path, &Budget::of_meshes())
}

/// As [`texture`], for a texture of the document with this budget.
pub(crate) fn texture_within(path: &Path, budget: &Budget) -> Result<Texture> {
    let mut bytes = Vec::new();
    files::read_picture(path, &mut bytes)?;
    budget.add_file(path, bytes.len() as u64);
    parse_texture(path, &bytes, budget)
}

/// As [`texture_within`], from the file's contents; `path` is for messages.
fn parse_texture(path: &Path, bytes: &[u8], budget: &Budget) -> Result<Texture> {
    /// Bytes per pixel of the converted picture and of the texture.
    const EXTRA: u64 = 8;
    // The others that the `image` crate decodes here have linear colours.
    let known = [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::WebP];
    let format = image::guess_format(bytes).ok().filter(|format| known.contains(format));
    let Some(format) = format else {
        return Err(Error::format(path, "not a picture for a texture (PNG, JPEG, WebP)"));
    };
    let reader = ImageReader::with_format(io::Cursor::new(bytes), format);
    let picture = files::catch_panics(path, || {
        let picture = files::decode_within(path, bytes, reader, EXTRA, Some(budget))?;
        picture.map_err(|error| match error {
            ImageError::IoError(error) => Error::io(path, "read", error),
            error => Error::format(path, format!("not a picture for a texture: {error}")),
        })
    })?;
    let size = UVec2::new(picture.width(), picture.height());
    let kept = u64::from(size.x) * u64::from(size.y) * size_of::<[u8; 4]>() as u64;
    budget.take(kept, path, Location::Byte(0))?;
    let pixels = picture.into_rgba8().pixels().map(|pixel| pixel.0).collect();
    Ok(Texture::new(size, pixels)?)
}

/// A corner of triangles.
#[derive(Clone, Copy, Default)]
struct Vertex {
    position: DVec3,
    normal: Vec3,
    /// (0, 0) is the first corner of a texture's first row.
    coordinates: Vec2,
}

/// A mesh in the making.
struct Builder<'a> {
    path: &'a Path,
    /// For textures, and for meshes that are repeated.
    budget: &'a Budget,
    mesh: LoadedMesh,
    /// The file has normals; vertices without one have 0.
    has_normals: bool,
    /// The file has texture coordinates; vertices without them have 0.
    has_coordinates: bool,
    /// Textures by resolved path; `None` for those that cannot be read.
    textures: HashMap<PathBuf, Option<Arc<Texture>>>,
}

impl<'a> Builder<'a> {
    fn new(path: &'a Path, budget: &'a Budget) -> Self {
        let (mesh, textures) = (LoadedMesh::default(), HashMap::new());
        Self { path, budget, mesh, has_normals: false, has_coordinates: false, textures }
    }

    /// Adds a vertex and returns its index. `fail` makes the error of a vertex out of range.
    fn vertex(&mut self, vertex: Vertex, fail: impl FnOnce(String) -> Error) -> Result<u32> {
        let Vertex { position, normal, coordinates } = vertex;
        let data = &mut self.mesh.data;
        let index = data.positions.len();
        let problem = if !is_position(position) {
            format!("position {:?}, expected less than 1e18", position.to_array())
        } else if !normal.is_finite() {
            format!("normal {:?}, expected finite numbers", normal.to_array())
        } else if !coordinates.is_finite() {
            format!("texture coordinates {:?}, expected finite numbers", coordinates.to_array())
        } else if index >= u32::MAX as usize {
            "too many vertices".into()
        } else {
            memory::grow(&mut data.positions, 1, self.path.display())?;
            memory::grow(&mut data.normals, 1, self.path.display())?;
            memory::grow(&mut data.coordinates, 1, self.path.display())?;
            data.positions.push(position);
            data.normals.push(normal);
            data.coordinates.push(coordinates);
            return Ok(index as u32);
        };
        Err(fail(format!("vertex {}: {problem}", index + 1)))
    }

    /// Adds a triangle; its corners must exist.
    fn triangle(&mut self, corners: [u32; 3], material: u32) -> Result<()> {
        let data = &mut self.mesh.data;
        memory::grow(&mut data.triangles, 1, self.path.display())?;
        memory::grow(&mut data.material_of, 1, self.path.display())?;
        data.triangles.push(corners);
        data.material_of.push(material);
        Ok(())
    }

    /// Adds a convex polygon.
    fn polygon(&mut self, corners: &[u32], material: u32) -> Result<()> {
        let Some((&first, rest)) = corners.split_first() else { return Ok(()) };
        rest.array_windows().try_for_each(|&[a, b]| self.triangle([first, a, b], material))
    }

    /// Adds a material and returns its index. `fail` makes the error of a colour out of range.
    fn material(&mut self, material: Material, fail: impl FnOnce(String) -> Error) -> Result<u32> {
        let color = material.color;
        if !is_radiance(color) {
            return Err(fail(format!("colour {:?}, expected 0 to 1e12", color.to_array())));
        }
        self.mesh.data.materials.push(material);
        Ok(self.mesh.data.materials.len() as u32 - 1)
    }

    /// Adds a remark about the file.
    fn remark(&mut self, problem: &str) {
        self.note(Error::format(self.path, problem).to_string());
    }

    /// Adds a sentence that names its file, unless there are many.
    fn note(&mut self, sentence: String) {
        /// More would not be read.
        const MOST: usize = 20;
        let remarks = &mut self.mesh.remarks;
        if remarks.len() < MOST && !remarks.contains(&sentence) {
            remarks.push(sentence);
        }
    }

    /// Adds the remark that transparent materials are drawn opaque; `what` says how the file makes them so.
    fn remark_opaque(&mut self, what: &str) {
        self.remark(&format!(
            "some of its materials are transparent ({what}) and are drawn opaque"
        ));
    }

    /// The path of a file that the mesh names: relative to its folder, or, since exporters write paths of
    /// their own machine, in its folder.
    fn beside(&self, name: &str) -> PathBuf {
        let name = name.replace('\\', "/");
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let path = folder.join(&name);
        let nearest = Path::new(&name).file_name().map(|name| folder.join(name));
        nearest.filter(|nearest| !files::is_file(&path) && files::is_file(nearest)).unwrap_or(path)
    }

    /// Reads a texture once, however often it is named. One that cannot be read is a remark.
    fn texture(&mut self, path: &Path) -> Result<Option<Arc<Texture>>> {
        let key = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        if let Some(texture) = self.textures.get(&key) {
            return Ok(texture.clone());
        }
        let texture = self.texture_or_remark(texture_within(path, self.budget))?;
        self.textures.insert(key, texture.clone());
        Ok(texture)
    }

    /// A texture, or a remark in its place.
    fn texture_or_remark(&mut self, texture: Result<Texture>) -> Result<Option<Arc<Texture>>> {
        match texture {
            Ok(texture) => Ok(Some(Arc::new(texture))),
            // A retry may find memory, and what is too large may be made to exhaust it.
            Err(error @ (Error::Render(limpid::Error::Memory { .. }) | Error::TooLarge { .. })) => {
                Err(error)
            }
            Err(error) => {
                self.note(format!("{error}; the surface has its colour alone"));
                Ok(None)
            }
        }
    }

    fn finish(self) -> Result<LoadedMesh> {
        let Self { path, mut mesh, has_normals, has_coordinates, .. } = self;
        if mesh.data.triangles.is_empty() {
            let problem = "no triangles or polygons; export the surface as a mesh";
            return Err(Error::format(path, problem));
        }
        if !has_normals {
            mesh.data.normals = Vec::new();
        }
        if !has_coordinates {
            mesh.data.coordinates = Vec::new();
        }
        if mesh.data.materials.is_empty() {
            mesh.data.material_of = Vec::new();
        }
        Ok(mesh)
    }
}
