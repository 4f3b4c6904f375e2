//! Files that the meshes of solids are read from.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use limpid::mesh::{Material, Mesh, MeshData, Texture};

/// Files and options that a mesh is read from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct MeshSource {
    /// The file, or the pattern of the files of all frames.
    pub(super) file: PathBuf,
    pub(super) texture: Option<PathBuf>,
    /// Turn textures upside down: formats and programs differ in where they begin.
    pub(super) flip: bool,
    pub(super) normals: Normals,
}

/// Where a mesh's shading normals come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Normals {
    /// From the file; flat triangles if it has none.
    #[default]
    File,
    /// Means of the adjacent triangles.
    Smooth,
    /// The triangles' own.
    Flat,
}

impl MeshSource {
    /// The mesh that was read from `path`; `texture` is that of the source.
    ///
    /// # Errors
    /// [`Error::Format`] naming the file, if it has no triangle with an area, or lacks the coordinates that the
    /// texture needs.
    pub(super) fn mesh(
        &self,
        path: &Path,
        data: MeshData,
        texture: Option<&Arc<Texture>>,
    ) -> Result<Mesh> {
        let mesh = checked(path, data)?;
        let mut mesh = match self.normals {
            Normals::File => mesh,
            Normals::Smooth => mesh.with_smooth_normals(),
            Normals::Flat => mesh.with_flat_normals(),
        };
        if self.flip {
            mesh = mesh.with_flipped_textures();
        }
        if let Some(texture) = texture {
            if mesh.coordinates().is_empty() {
                let problem =
                    "it has no texture coordinates, which a texture needs; color or checker do not";
                return Err(Error::format(path, problem));
            }
            let texture = Some(texture.clone());
            mesh = mesh.with_material(Material { color: Vec3::ONE, texture });
        }
        Ok(mesh)
    }
}

/// The mesh that was read from `path`.
///
/// # Errors
/// [`Error::Format`] naming the file, if it has no triangle with an area.
pub(super) fn checked(path: &Path, data: MeshData) -> Result<Mesh> {
    Mesh::new(data).map_err(|e| match e {
        limpid::Error::Invalid { problem, .. } => Error::format(path, problem),
        other => other.into(),
    })
}
