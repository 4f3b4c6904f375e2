//! Rigid bodies of `SPlisHSPlasH` (its sources `RigidBodyExporter_BIN.cpp` and `BinaryFileReaderWriter.h`):
//! files `rigid_bodies/rb_data_N.bin`, N being the frame, with the mesh files of the bodies beside them. All
//! numbers are little-endian:
//!
//! ```text
//! first frame:   u32 count
//!                count × { u32 length, bytes: the mesh file's name
//!                          f32 scale[3]   u8 is it a wall   f32 colour[4] }
//! every frame:   count × { f32 translation[3]   f32 rotation[3][3], column by column }
//! ```
//!
//! A vertex x of a mesh file is at rotation · (scale ∘ x) + translation, in metres. If no body can move,
//! only the first frame is written.

use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3, Vec4};
use limpid::camera::is_position;

use crate::error::Result;
use crate::files;
use crate::particles::cursor::Cursor;

/// A body, as the first frame describes it.
#[derive(Debug, Clone, PartialEq)]
pub struct RigidBody {
    /// Its mesh file, in the folder of the frames.
    pub mesh: PathBuf,
    /// Scale of the mesh along each of its axes; finite.
    pub scale: DVec3,
    /// Whether the scene calls it a wall: the container, which is seldom drawn.
    pub is_wall: bool,
    /// Red, green, blue and opacity, as the scene file gives them, by convention 0 to 1; finite.
    pub color: Vec4,
    /// Where it is in the first frame.
    pub pose: Pose,
}

/// Where a body is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Position of the mesh's origin, m.
    pub translate: DVec3,
    /// Rotation of the scaled mesh about its origin; of unit length.
    pub rotate: DQuat,
}

impl Pose {
    /// The pose in which a mesh is where its file has it.
    pub const IDENTITY: Self = Self { translate: DVec3::ZERO, rotate: DQuat::IDENTITY };
}

/// Largest size of a frame, bytes: a million bodies take a hundred MiB.
const LIMIT: u64 = 1 << 30;

/// Reads the bodies and their poses from the first frame.
///
/// # Errors
///
/// [`Error::Io`] if the file cannot be read, and [`Error::Malformed`], with the place, if it is too short or
/// too long, has a number that is not finite or a matrix that is no rotation. Later frames, which have no
/// descriptions, are such files.
///
/// [`Error::Io`]: crate::Error::Io
/// [`Error::Malformed`]: crate::Error::Malformed
pub fn read_bodies(path: &Path) -> Result<Vec<RigidBody>> {
    /// Shortest description and pose, bytes.
    const SHORTEST: usize = 4 + 12 + 1 + 16 + 48;
    let mut bytes = Vec::new();
    files::read(path, |_| LIMIT, &mut bytes)?;
    let mut file = Cursor::new(path, &bytes, false);
    let count = u32::from_le_bytes(file.array("the number of bodies")?) as usize;
    // Poses alone may begin with a 0.
    let poses_alone = count == 0 && !file.rest().is_empty();
    if poses_alone || count > file.rest().len() / SHORTEST {
        let problem = format!("{count} bodies do not fit into the file; is it the first frame?");
        return Err(file.error(problem));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut bodies = Vec::with_capacity(count);
    for _ in 0..count {
        let length = u32::from_le_bytes(file.array("the length of a name")?) as usize;
        let name = std::str::from_utf8(file.take(length, "the name of a mesh file")?);
        let name = name.map_err(|_| file.error("the name of a mesh file is not text in UTF-8"))?;
        if name.is_empty() || name.contains('\0') {
            return Err(file.error("a body has no mesh file; is this the first frame?"));
        }
        let mesh = folder.join(name);
        let scale = DVec3::from(numbers(&mut file, "the scale")?);
        let [is_wall] = file.array("the kind of a body")?;
        let color = numbers(&mut file, "the colour")?.map(|c| c as f32);
        let (is_wall, color) = (is_wall != 0, Vec4::from(color));
        bodies.push(RigidBody { mesh, scale, is_wall, color, pose: Pose::IDENTITY });
    }
    for body in &mut bodies {
        body.pose = pose(&mut file)?;
    }
    ended(&file, count)?;
    Ok(bodies)
}

/// Reads the poses of `count` bodies, in their order, from a frame after the first.
///
/// # Errors
///
/// As [`read_bodies`]; a frame with another number of bodies is too short or too long.
pub fn read_poses(path: &Path, count: usize) -> Result<Vec<Pose>> {
    let mut bytes = Vec::new();
    files::read(path, |_| LIMIT, &mut bytes)?;
    let mut file = Cursor::new(path, &bytes, false);
    let mut poses = Vec::new();
    for _ in 0..count {
        poses.push(pose(&mut file)?);
    }
    ended(&file, count)?;
    Ok(poses)
}

fn pose(file: &mut Cursor<'_>) -> Result<Pose> {
    /// Largest error of a rotation's products: of 32-bit numbers that were rotated often.
    const TOLERANCE: f64 = 1e-3;
    let translate = DVec3::from(numbers(file, "the translation")?);
    if !is_position(translate) {
        let problem = format!("translation {:?}, expected less than 1e18 m", translate.to_array());
        return Err(file.error(problem));
    }
    let rotation = DMat3::from_cols_array(&numbers(file, "the rotation")?);
    let product = rotation.transpose() * rotation;
    if !product.abs_diff_eq(DMat3::IDENTITY, TOLERANCE) || rotation.determinant() < 0.0 {
        let columns = rotation.to_cols_array_2d();
        return Err(file.error(format!("the matrix of columns {columns:?} is no rotation")));
    }
    Ok(Pose { translate, rotate: DQuat::from_mat3(&rotation).normalize() })
}

/// Takes finite numbers.
fn numbers<const N: usize>(file: &mut Cursor<'_>, what: &str) -> Result<[f64; N]> {
    let bytes = file.take_records(N, size_of::<f32>(), what)?;
    let mut numbers = [0.0; N];
    for (number, bytes) in numbers.iter_mut().zip(bytes.as_chunks().0) {
        *number = f64::from(f32::from_le_bytes(*bytes));
    }
    if numbers.iter().all(|number| number.is_finite()) {
        Ok(numbers)
    } else {
        Err(file.error(format!("{what} is {numbers:?}, expected finite numbers")))
    }
}

/// Fails if something follows the last pose.
fn ended(file: &Cursor<'_>, count: usize) -> Result<()> {
    match file.rest().len() {
        0 => Ok(()),
        more => {
            let problem = format!("{more} bytes follow the poses of {count} bodies");
            Err(file.source.error(file.offset, problem))
        }
    }
}
