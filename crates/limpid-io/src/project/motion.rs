//! How solids move: key frames, a mesh for each frame, and rigid bodies.

use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DQuat, DVec3, DVec4};
use serde::{Deserialize, Serialize};

use super::bodies::Bodies;
use super::mesh_sequence::MeshSequence;
use crate::error::Result;
use crate::particles::Remark;
use crate::sequence::{FrameTime, Missing, Sequence};
use limpid::camera::is_position;
use limpid::scene::{Scene, Shape, Solid};

/// How the solids of a scene move. It belongs to the scene of its file: solids are known by their index.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SolidMotion {
    /// By the solid's index, ascending.
    own: Vec<(usize, Motion)>,
    /// The rigid bodies, from the solid of this index on.
    bodies: Option<(usize, Bodies)>,
}

/// How a solid moves: by keys, by a mesh for each frame, or both.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Motion {
    pub(super) keys: Vec<Key>,
    pub(super) meshes: Option<Arc<MeshSequence>>,
}

/// Where a solid is at a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Key {
    frame: f64,
    /// Position of a mesh, m; of other shapes, how far they have moved.
    translate: Option<DVec3>,
    /// Of a mesh; of unit length.
    rotate: Option<DQuat>,
}

/// A `[[solid.key]]`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct KeyFile {
    frame: f64,
    translate: Option<DVec3>,
    rotate: Option<DVec4>,
    quaternion: Option<DQuat>,
}

impl From<Key> for KeyFile {
    fn from(Key { frame, translate, rotate }: Key) -> Self {
        Self { frame, translate, rotate: None, quaternion: rotate }
    }
}

/// The keys of a solid's tables. `shape` names the shape if it cannot turn.
pub(super) fn keys(files: &[KeyFile], shape: Option<&str>) -> Result<Vec<Key>, String> {
    let mut keys: Vec<Key> = Vec::new();
    let mut last: Option<DVec4> = None;
    for (number, file) in (1..).zip(files) {
        let fail = |problem: String| format!("key {number}: {problem}");
        let &KeyFile { frame, translate, rotate, quaternion } = file;
        if !frame.is_finite() {
            return Err(fail(format!("frame is {frame}, expected a finite number")));
        }
        if let Some(before) = keys.last().filter(|before| frame <= before.frame) {
            let problem = format!("frame is {frame}, expected more than {} before", before.frame);
            return Err(fail(problem));
        }
        if !translate.is_none_or(is_position) {
            return Err(fail("translate must be finite".into()));
        }
        let turns = rotate.is_some() || quaternion.is_some();
        if let Some(shape) = shape.filter(|_| turns) {
            let problem = format!("a {shape} does not turn; take a mesh of this shape");
            return Err(fail(problem));
        }
        if translate.is_none() && !turns {
            return Err(fail("needs translate, rotate or quaternion".into()));
        }
        // The same axis tells how far the user means to turn; poses do not.
        if let (Some(from), Some(to)) = (last, rotate)
            && let Some(turn) = turn_between(from, to).filter(|turn| *turn >= 180.0)
        {
            let problem = format!(
                "turns by {turn} degrees since the key before, and solids turn along the shorter arc; \
                 put keys less than 180 degrees apart"
            );
            return Err(fail(problem));
        }
        last = if turns { rotate } else { last };
        let rotate = match turns {
            true => Some(rotation(rotate, quaternion).map_err(fail)?),
            false => None,
        };
        keys.push(Key { frame, translate, rotate });
    }
    Ok(keys)
}

/// Degrees between two rotations about one axis, or about opposite ones; `None` about others.
fn turn_between(from: DVec4, to: DVec4) -> Option<f64> {
    const SAME: f64 = 1e-6;
    let angle = from.truncate().angle_between(to.truncate());
    let opposite = angle > std::f64::consts::PI - SAME;
    let degrees = if opposite { -to.w } else { to.w };
    (angle < SAME || opposite).then(|| (degrees - from.w).abs())
}

/// A rotation, from an axis and degrees or a quaternion.
pub(super) fn rotation(rotate: Option<DVec4>, quaternion: Option<DQuat>) -> Result<DQuat, String> {
    match (rotate, quaternion) {
        (None, None) => Ok(DQuat::IDENTITY),
        (None, Some(q)) if q.is_normalized() => Ok(q),
        (None, Some(q)) if q.length() > 0.0 && q.is_finite() => Ok(q.normalize()),
        (None, Some(_)) => Err("quaternion must not be zero: x, y, z, w".into()),
        (Some(rotate), None) => {
            let axis = rotate.truncate().try_normalize().filter(|_| rotate.w.is_finite());
            let axis = axis.ok_or("rotate takes an axis, which must not be zero, and degrees")?;
            Ok(DQuat::from_axis_angle(axis, rotate.w.to_radians()))
        }
        (Some(_), Some(_)) => Err("takes one of rotate and quaternion".into()),
    }
}

/// The value of keys at a time: the first before them, the last after them; `between` two of them it takes both
/// and the fraction.
fn sample<T: Copy>(
    keys: impl Iterator<Item = (f64, T)>,
    time: f64,
    between: impl Fn(T, T, f64) -> T,
) -> Option<T> {
    let mut before = None;
    for (frame, value) in keys {
        if frame >= time {
            return Some(match before {
                Some((from, last)) if frame > time => {
                    between(last, value, (time - from) / (frame - from))
                }
                _ => value,
            });
        }
        before = Some((frame, value));
    }
    before.map(|(_, value)| value)
}

impl Motion {
    pub(super) fn is_empty(&self) -> bool {
        self.keys.is_empty() && self.meshes.is_none()
    }

    /// The shape at a time, from that at rest; `None` if it has no mesh then.
    fn at(
        &self,
        at: FrameTime,
        rest: &Shape,
        missing: Missing,
        remarks: &mut Vec<Remark>,
    ) -> Result<Option<Shape>> {
        let time = at.time();
        let places = self.keys.iter().filter_map(|key| Some((key.frame, key.translate?)));
        let place = sample(places, time, |a, b, t| a.lerp(b, t));
        let turns = self.keys.iter().filter_map(|key| Some((key.frame, key.rotate?)));
        let turn = sample(turns, time, |a: DQuat, b, t| a.slerp(b, t).normalize());
        let moved = place.unwrap_or_default();
        let mut shape = rest.clone();
        match &mut shape {
            Shape::Plane { origin, .. } => *origin += moved,
            Shape::Box { min, max } => {
                *min += moved;
                *max += moved;
            }
            Shape::Sphere { center, .. } => *center += moved,
            Shape::Mesh { mesh, placement } => {
                placement.translate = place.unwrap_or(placement.translate);
                placement.rotate = turn.unwrap_or(placement.rotate);
                if let Some(meshes) = &self.meshes {
                    let Some(now) = meshes.at(at, missing, remarks)? else { return Ok(None) };
                    *mesh = now;
                }
            }
        }
        Ok(Some(shape))
    }
}

impl SolidMotion {
    /// Whether no solid moves.
    pub fn is_empty(&self) -> bool {
        self.own.is_empty() && self.bodies.is_none()
    }

    /// Adds the motion of the solid of this index, which is above those before.
    pub(super) fn push(&mut self, index: usize, motion: Motion) {
        if !motion.is_empty() {
            self.own.push((index, motion));
        }
    }

    /// Sets the rigid bodies, whose solids begin at this index.
    pub(super) fn set_bodies(&mut self, index: usize, bodies: Bodies) {
        self.bodies = Some((index, bodies));
    }

    /// The motion of the solid of this index, unless it is a rigid body.
    pub(super) fn of(&self, index: usize) -> Option<&Motion> {
        self.own.iter().find(|(known, _)| *known == index).map(|(_, motion)| motion)
    }

    pub(super) fn bodies(&self) -> Option<&Bodies> {
        self.bodies.as_ref().map(|(_, bodies)| bodies)
    }

    /// Follows the insertion of a solid that stands still.
    pub(super) fn insert(&mut self, at: usize) {
        let of_bodies = self.bodies.iter_mut().map(|(index, _)| index);
        let indices = self.own.iter_mut().map(|(index, _)| index).chain(of_bodies);
        indices.filter(|index| **index >= at).for_each(|index| *index += 1);
    }

    /// Follows the removal of solids: `kept` says of each whether it stays.
    pub(crate) fn retain(&mut self, kept: &[bool]) {
        let stays = |index: usize| kept.get(index).is_none_or(|&kept| kept);
        let new = |index: usize| (0..index).filter(|&before| stays(before)).count();
        self.own.retain(|(index, _)| stays(*index));
        self.own.iter_mut().for_each(|(index, _)| *index = new(*index));
        if let Some((index, _)) = &mut self.bodies {
            *index = new(*index);
        }
    }

    /// Changes the paths, for a scene file in another folder.
    pub(super) fn map_paths(&mut self, map: impl Fn(&Path) -> PathBuf) {
        if let Some((_, bodies)) = &mut self.bodies {
            bodies.map_paths(map);
        }
    }

    /// The sequences of files that have to have a shown frame.
    pub(crate) fn sequences(&self) -> impl Iterator<Item = &Sequence> {
        let meshes = self.own.iter().filter_map(|(_, motion)| motion.meshes.as_ref());
        let bodies = self.bodies().and_then(Bodies::sequence);
        meshes.map(|meshes| &meshes.sequence).chain(bodies)
    }

    /// The keys of all solids, as text that differs between different ones.
    pub fn keys(&self) -> String {
        let keys = self.own.iter().map(|(index, motion)| (index, &motion.keys));
        format!("{:?}", keys.collect::<Vec<_>>())
    }

    /// The files that decide where solids are at a frame time.
    pub fn files(&self, at: FrameTime, missing: Missing) -> Vec<&Path> {
        let numbers = if at.fraction == 0.0 { vec![at.frame] } else { vec![at.frame, at.next] };
        let files = self.sequences().flat_map(|sequence| {
            let frames = numbers.iter().filter_map(|&number| sequence.shown(number, missing));
            frames.map(|frame| frame.path.as_path()).collect::<Vec<_>>()
        });
        files.collect()
    }

    /// Where the moving ones of a scene's solids are at a frame time.
    pub(crate) fn at(&self, at: FrameTime, solids: &[Solid], missing: Missing) -> Result<Moved> {
        let mut moved = Moved::default();
        for (index, motion) in &self.own {
            let Some(solid) = solids.get(*index) else { continue };
            let shape = motion.at(at, &solid.shape, missing, &mut moved.remarks)?;
            if let (Some(_), Some(Shape::Mesh { mesh, .. })) = (&motion.meshes, &shape) {
                moved.bytes += mesh.bytes();
            }
            moved.shapes.push((*index, shape));
        }
        if let Some((first, bodies)) = &self.bodies {
            let placements = bodies.at(at, missing, &mut moved.remarks)?;
            for i in 0..bodies.len() {
                let shape = match (solids.get(first + i).map(|solid| &solid.shape), &placements) {
                    (Some(Shape::Mesh { mesh, .. }), Some(placements)) => {
                        Some(Shape::Mesh { mesh: mesh.clone(), placement: placements[i] })
                    }
                    _ => None,
                };
                moved.shapes.push((first + i, shape));
            }
        }
        Ok(moved)
    }
}

/// Where the moving ones of a scene's solids are at a time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Moved {
    /// By the solid's index, ascending; `None` for one that is not there.
    shapes: Vec<(usize, Option<Shape>)>,
    /// Memory of meshes that belong to this time alone, bytes.
    bytes: u64,
    /// Files that could not be read, and are replaced.
    remarks: Vec<Remark>,
}

impl Moved {
    /// The solids where they are; `solids` are the scene's, in its order.
    pub fn solids<'a>(&self, solids: &'a [Solid]) -> Cow<'a, [Solid]> {
        if self.shapes.is_empty() {
            return solids.into();
        }
        let mut moving = self.shapes.iter().peekable();
        let shown = solids.iter().enumerate().filter_map(|(i, solid)| {
            match moving.next_if(|(index, _)| *index == i) {
                None => Some(solid.clone()),
                Some((_, shape)) => Some(Solid { shape: shape.clone()?, ..solid.clone() }),
            }
        });
        shown.collect()
    }

    /// The scene with its solids where they are.
    pub fn scene<'a>(&self, scene: &'a Scene) -> Cow<'a, Scene> {
        match self.solids(&scene.solids) {
            Cow::Borrowed(_) => Cow::Borrowed(scene),
            Cow::Owned(solids) => Cow::Owned(Scene { solids, ..scene.clone() }),
        }
    }

    /// Remarks on the files that could not be read, and are replaced.
    pub fn remarks(&self) -> &[Remark] {
        &self.remarks
    }

    /// Memory of meshes that belong to this time alone, bytes.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}
