//! Solids with a mesh for each frame.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError, Weak};

use super::mesh_source::MeshSource;
use super::recent::Recent;
use crate::budget::Budget;
use crate::error::Result;
use crate::files;
use crate::meshes;
use crate::particles::Remark;
use crate::pattern::placeholder;
use crate::sequence::{Frame, FrameTime, Missing, Sequence};
use limpid::mesh::{Mesh, MeshData, Texture};

/// Meshes of numbered files. A few are in memory; a mesh that is still in use elsewhere is never made again.
#[derive(Debug)]
pub(super) struct MeshSequence {
    pub(super) source: MeshSource,
    pub(super) sequence: Sequence,
    texture: Option<Arc<Texture>>,
    recent: Recent<MeshFrame>,
    /// The meshes in use, by the frame's number.
    used: Mutex<BTreeMap<i64, Weak<Mesh>>>,
}

/// A frame's mesh, and what its file holds, for interpolation.
#[derive(Debug)]
struct MeshFrame {
    number: i64,
    data: MeshData,
    mesh: Arc<Mesh>,
}

impl PartialEq for MeshSequence {
    fn eq(&self, other: &Self) -> bool {
        self.source == other.source && self.sequence == other.sequence
    }
}

impl MeshSequence {
    /// Whether `file` is the pattern of a sequence; a file of that very name is not.
    pub(super) fn is_pattern(file: &Path) -> bool {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        placeholder(&name).is_some() && !files::is_file(file)
    }

    /// Finds the files of a pattern, and reads the first, whose mesh and remarks are returned.
    ///
    /// # Errors
    /// As [`Sequence::open`] and [`meshes::load`].
    pub(super) fn open(
        source: MeshSource,
        texture: Option<Arc<Texture>>,
        budget: &Budget,
    ) -> Result<(Self, Arc<Mesh>, Vec<String>)> {
        let sequence = Sequence::open(&source.file)?;
        let (recent, used) = (Recent::default(), Mutex::default());
        let all = Self { source, sequence, texture, recent, used };
        let mut remarks = Vec::new();
        let first = all.read(&all.sequence.frames[0], &mut remarks, budget)?;
        Ok((all, first.mesh.clone(), remarks))
    }

    fn read(
        &self,
        frame: &Frame,
        remarks: &mut Vec<String>,
        budget: &Budget,
    ) -> Result<Arc<MeshFrame>> {
        self.recent.get(frame.number, || {
            let loaded = meshes::load_within(&frame.path, budget)?;
            remarks.extend(loaded.remarks);
            let mesh = match self.used(frame.number, None) {
                Some(mesh) => mesh,
                None => {
                    let texture = self.texture.as_ref();
                    let mesh = self.source.mesh(&frame.path, loaded.data.clone(), texture)?;
                    let mesh = Arc::new(mesh);
                    self.used(frame.number, Some(&mesh)).unwrap_or(mesh)
                }
            };
            Ok(MeshFrame { number: frame.number, data: loaded.data, mesh })
        })
    }

    /// The mesh of a frame that is in use, or `new`, which is then.
    fn used(&self, number: i64, new: Option<&Arc<Mesh>>) -> Option<Arc<Mesh>> {
        let mut used = self.used.lock().unwrap_or_else(PoisonError::into_inner);
        used.retain(|_, mesh| mesh.strong_count() > 0);
        let mesh = used.get(&number).and_then(Weak::upgrade).or_else(|| new.cloned())?;
        used.insert(number, Arc::downgrade(&mesh));
        Some(mesh)
    }

    /// The mesh at a time; `None` if there is none. Between two frames of the same triangles each corner moves
    /// along a straight line; otherwise the earlier frame's mesh is shown.
    ///
    /// # Errors
    /// [`crate::Error::MissingFrame`] for a missing frame that must not be; as [`meshes::load`].
    pub(super) fn at(
        &self,
        at: FrameTime,
        missing: Missing,
        remarks: &mut Vec<Remark>,
    ) -> Result<Option<Arc<Mesh>>> {
        let is_frame = at.fraction == 0.0;
        let shown = self.sequence.shown_or_missing(at.frame, missing)?;
        let used = shown.and_then(|shown| self.used(shown.number, None));
        if let Some(mesh) = used.filter(|_| is_frame) {
            return Ok(Some(mesh));
        }
        let mut read = |number| {
            let read = |frame: &Frame| self.read(frame, &mut Vec::new(), &Budget::of_meshes());
            let shown = self.sequence.read_shown(number, missing, remarks, read);
            shown.map(|shown| shown.map(|(_, mesh)| mesh))
        };
        let Some(earlier) = read(at.frame)? else { return Ok(None) };
        if is_frame {
            return Ok(Some(earlier.mesh.clone()));
        }
        let later = read(at.next)?;
        let later = later.filter(|later| later.number != earlier.number);
        match later.filter(|later| have_same_triangles(&earlier.data, &later.data)) {
            None => Ok(Some(earlier.mesh.clone())),
            Some(later) => {
                let data = between(&earlier.data, &later.data, at.fraction);
                let mesh = self.source.mesh(&self.source.file, data, self.texture.as_ref());
                // Corners that change places leave no area half-way.
                Ok(Some(mesh.map_or_else(|_| earlier.mesh.clone(), Arc::new)))
            }
        }
    }
}

fn have_same_triangles(a: &MeshData, b: &MeshData) -> bool {
    let counts = |data: &MeshData| (data.positions.len(), data.normals.len());
    counts(a) == counts(b) && a.triangles == b.triangles
}

/// Moves the corners along straight lines from `a` to `b`; colours and textures are those of `a`.
fn between(a: &MeshData, b: &MeshData, fraction: f64) -> MeshData {
    let positions = a.positions.iter().zip(&b.positions).map(|(a, b)| a.lerp(*b, fraction));
    let normals = a.normals.iter().zip(&b.normals).map(|(a, b)| {
        let [a, b] = [a, b].map(|n| n.normalize_or_zero());
        a.lerp(b, fraction as f32)
    });
    MeshData { positions: positions.collect(), normals: normals.collect(), ..a.clone() }
}
