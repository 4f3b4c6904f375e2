//! Rigid bodies of `SPlisHSPlasH` as solids: `[rigid_bodies]`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::mesh_source::checked;
use super::recent::Recent;
use crate::budget::Budget;
use crate::error::{Error, Result};
use crate::meshes::rigid_bodies::{Pose, RigidBody, read_bodies, read_poses};
use crate::meshes::{self, LoadedMesh};
use crate::particles::Remark;
use crate::sequence::{Frame, FrameTime, Missing, Sequence};
use limpid::liquid::Up;
use limpid::mesh::{Mesh, MeshData, Placement, linear_from_srgb};
use limpid::scene::{MAX_SOLIDS, Shape, Solid, Surface};

/// A `[rigid_bodies]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BodiesFile {
    /// The files of the frames: a pattern, or the first, for bodies that stand still.
    source: PathBuf,
    /// Whether walls, which hold the liquid, are drawn too.
    #[serde(default)]
    walls: bool,
    /// Whether the colours are albedos under the lights.
    #[serde(default)]
    lit: bool,
    /// The axis of the files that points up.
    #[serde(default)]
    up: Up,
}

/// Solids of rigid bodies, and the files of their poses.
#[derive(Debug, Clone)]
pub(super) struct Bodies {
    file: BodiesFile,
    sequence: Sequence,
    /// For each solid, the body's number in the files.
    drawn: Vec<usize>,
    /// Poses of all bodies in the first frame.
    first: Arc<Vec<Pose>>,
    recent: Arc<Recent<Vec<Pose>>>,
}

impl PartialEq for Bodies {
    fn eq(&self, other: &Self) -> bool {
        let parts = |bodies: &Self| (bodies.file.clone(), bodies.sequence.clone());
        parts(self) == parts(other) && self.drawn == other.drawn && self.first == other.first
    }
}

impl Bodies {
    /// Finds the files, and reads the bodies of the first and their meshes, whose remarks are added.
    ///
    /// # Errors
    /// As [`Sequence::open`], [`read_bodies`] and [`meshes::load`]; [`Error::Format`] for a body without an extent.
    pub(super) fn open(
        file: &BodiesFile,
        folder: &Path,
        remarks: &mut Vec<String>,
        budget: &Budget,
    ) -> Result<(Self, Vec<Solid>)> {
        let file = BodiesFile { source: folder.join(&file.source), ..file.clone() };
        let sequence = Sequence::open(&file.source)?;
        let path = &sequence.frames[0].path;
        let bodies = read_bodies(path)?;
        let is_drawn = |&number: &usize| file.walls || !bodies[number].is_wall;
        let drawn: Vec<usize> = (0..bodies.len()).filter(is_drawn).collect();
        if drawn.len() > MAX_SOLIDS {
            let problem = format!("{} bodies; at most {MAX_SOLIDS} can be drawn", drawn.len());
            return Err(Error::format(path, problem));
        }
        let mut solids = Vec::new();
        let mut known: Vec<(&RigidBody, Arc<Mesh>)> = Vec::new();
        for &number in &drawn {
            let body = &bodies[number];
            let same = |(other, _): &&(&RigidBody, _)| {
                (&other.mesh, other.scale) == (&body.mesh, body.scale)
            };
            let mesh = match known.iter().find(same) {
                Some((_, mesh)) => mesh.clone(),
                None => {
                    let mesh = Arc::new(mesh_of(path, number, body, remarks, budget)?);
                    known.push((body, mesh.clone()));
                    mesh
                }
            };
            let color = body.color.truncate().map(|c| linear_from_srgb(c.clamp(0.0, 1.0)));
            let shape = Shape::Mesh { mesh, placement: placement(file.up, body.pose) };
            solids.push(Solid { shape, surface: Surface::Color(color), lit: file.lit });
        }
        if solids.is_empty() {
            let what = if bodies.is_empty() {
                "no bodies"
            } else {
                "walls alone; walls = true draws them"
            };
            remarks.push(Error::format(path, what).to_string());
        }
        let first = Arc::new(bodies.iter().map(|body| body.pose).collect());
        Ok((Self { file, sequence, drawn, first, recent: Arc::default() }, solids))
    }

    /// The table that it was made from.
    pub(super) fn file(&self) -> &BodiesFile {
        &self.file
    }

    pub(super) fn map_paths(&mut self, map: impl Fn(&Path) -> PathBuf) {
        self.file.source = map(&self.file.source);
    }

    /// The files of all frames; `None` if the first holds for all, as `SPlisHSPlasH` writes no more for bodies
    /// that cannot move.
    pub(super) fn sequence(&self) -> Option<&Sequence> {
        Some(&self.sequence).filter(|sequence| sequence.frames.len() > 1)
    }

    /// Number of solids.
    pub(super) fn len(&self) -> usize {
        self.drawn.len()
    }

    fn poses(
        &self,
        number: i64,
        missing: Missing,
        remarks: &mut Vec<Remark>,
    ) -> Result<Option<Arc<Vec<Pose>>>> {
        let Some(sequence) = self.sequence() else { return Ok(Some(self.first.clone())) };
        let count = self.first.len();
        let read = |frame: &Frame| match frame.number == sequence.frames[0].number {
            true => Ok(self.first.clone()),
            false => self.recent.get(frame.number, || read_poses(&frame.path, count)),
        };
        let shown = sequence.read_shown(number, missing, remarks, read)?;
        Ok(shown.map(|(_, poses)| poses))
    }

    /// For each solid, where it is at a time; `None` if there is no such frame. Between frames bodies move along
    /// straight lines and turn the shorter way.
    ///
    /// # Errors
    /// [`Error::MissingFrame`] for a missing frame that must not be; as [`read_poses`].
    pub(super) fn at(
        &self,
        at: FrameTime,
        missing: Missing,
        remarks: &mut Vec<Remark>,
    ) -> Result<Option<Vec<Placement>>> {
        let Some(earlier) = self.poses(at.frame, missing, remarks)? else { return Ok(None) };
        let later = match at.fraction {
            0.0 => None,
            _ => self.poses(at.next, missing, remarks)?,
        };
        let later = later.as_ref().unwrap_or(&earlier);
        let pose = |&number: &usize| {
            let (a, b) = (earlier[number], later[number]);
            let pose = Pose {
                translate: a.translate.lerp(b.translate, at.fraction),
                rotate: if a == b { a.rotate } else { a.rotate.slerp(b.rotate, at.fraction) },
            };
            placement(self.file.up, pose)
        };
        Ok(Some(self.drawn.iter().map(pose).collect()))
    }
}

/// The placement of a scaled mesh, y up.
fn placement(up: Up, Pose { translate, rotate }: Pose) -> Placement {
    match up {
        Up::Y => Placement { translate, rotate, scale: 1.0 },
        Up::Z => {
            let translate = DVec3::new(translate.x, translate.z, -translate.y);
            let turn = DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2);
            Placement { translate, rotate: (turn * rotate).normalize(), scale: 1.0 }
        }
    }
}

/// The mesh of a body, scaled along its own axes. `path` and `number`, from 0, are for messages.
fn mesh_of(
    path: &Path,
    number: usize,
    body: &RigidBody,
    remarks: &mut Vec<String>,
    budget: &Budget,
) -> Result<Mesh> {
    let scale = body.scale;
    if !scale.recip().is_finite() {
        let problem = format!("body {} has the scale {scale}, expected no 0", number + 1);
        return Err(Error::format(path, problem));
    }
    let LoadedMesh { data, remarks: more } = meshes::load_within(&body.mesh, budget)?;
    remarks.extend(more);
    checked(&body.mesh, scaled(data, scale))
}

/// Scales a mesh along its axes; a mirrored one keeps its outside.
fn scaled(mut data: MeshData, scale: DVec3) -> MeshData {
    data.positions.iter_mut().for_each(|x| *x *= scale);
    // Normals stay perpendicular to what is stretched.
    let inverse = (scale.recip() / scale.recip().abs().max_element()).as_vec3();
    data.normals.iter_mut().for_each(|normal| *normal = normal.normalize_or_zero() * inverse);
    if scale.x * scale.y * scale.z < 0.0 {
        data.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    data
}
