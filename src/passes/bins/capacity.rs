//! How many entries the lists of a view's splats have at most: the memory for them is made before they are counted.

use std::f64::consts::PI;

use glam::{DVec2, Mat3, Vec2, Vec3};
use rayon::prelude::*;

use crate::camera::CameraUniform;
use crate::gpu::TILE;
use crate::liquid::blocks::{self, Block};
use crate::liquid::classify::{DeviceSplats, Splat as SplatData};

/// Upper bound of the entries of the lists of splats `swell` times as large, which `blocks` hold, if there are any.
pub(super) fn most_entries(
    splats: &[SplatData],
    blocks: &[Block],
    camera: &CameraUniform,
    swell: f32,
) -> u64 {
    let view = ScreenBounds::new(camera, swell);
    let of_chunk = |(i, splats): (usize, &[SplatData])| {
        let each = blocks.get(i).and_then(|block| view.tiles_of_each(block));
        each.map_or_else(
            || splats.iter().map(|splat| view.tiles(splat)).sum(),
            |each| each * splats.len() as u64,
        )
    };
    splats.par_chunks(blocks::SIZE).enumerate().map(of_chunk).sum()
}

/// About how many entries the lists of splats `swell` times as large have that only the device knows, rather more than
/// fewer: as if they were packed twice as densely as liquid, around the eye or as near to it as their box.
pub(super) fn likely_entries(splats: &DeviceSplats, camera: &CameraUniform, swell: f32) -> u64 {
    /// Particles in the volume of one at rest.
    const PACKING: f64 = 2.0;
    const SHELLS: u32 = 64;
    let tiles = (camera.size / TILE as f32).ceil().as_dvec2();
    let count = f64::from(splats.count);
    let reach = f64::from(swell * splats.usual_reach);
    // Tiles across a splat at depth 1, or at any.
    let tangent = camera.tangent.as_dvec2();
    let across = camera.size.as_dvec2() / tangent * reach / f64::from(TILE);
    let tiles_at = |depth: f64| (across / depth + 2.0).min(tiles).element_product();
    if camera.far > 0.0 {
        return (count * tiles_at(1.0)) as u64;
    }
    let half_angles = DVec2::new(tangent.x.atan(), tangent.y.atan());
    let solid_angle = (4.0 * half_angles.element_product() * 1.5).min(4.0 * PI);
    // The eye is the origin of the view.
    let nearest = splats.distance(-camera.origin.as_dvec3()).max(f64::from(camera.near));
    // The volume of a particle at rest, (2 r)³, from the usual reach of a splat, which is 1.1 to 1.5 times its particle's spacing.
    let volume = (splats.usual_reach as f64).powi(3) / PACKING;
    let farthest = (nearest.powi(3) + 3.0 * count * volume / solid_angle).cbrt();
    let shell = |i: u32| {
        let at = |i: u32| nearest + (farthest - nearest) * f64::from(i) / f64::from(SHELLS);
        let (near, far) = (at(i), at(i + 1));
        let particles = solid_angle / 3.0 * (far.powi(3) - near.powi(3)) / volume;
        particles * tiles_at(near.max(f64::MIN_POSITIVE))
    };
    (0..SHELLS).map(shell).sum::<f64>() as u64
}

/// Bounds on the tiles that splats touch in a view: those that boxes around them touch.
struct ScreenBounds<'a> {
    camera: &'a CameraUniform,
    view_from_world: Mat3,
    swell: f32,
    /// Tiles of the picture.
    tiles: Vec2,
}

impl<'a> ScreenBounds<'a> {
    /// Pixels around a splat, against rounding, which differs on the device.
    const MARGIN: f32 = 2.0;
    /// Least depth of a block of whose splats one bound for all is of use, in halves of its box.
    const DISTANT: f32 = 3.0;
    /// Greatest reach of such splats, in means of it.
    const ALIKE: f32 = 2.0;

    fn new(camera: &'a CameraUniform, swell: f32) -> Self {
        let [x, y, z] = camera.view_from_world.map(|[x, y, z, _]| Vec3::new(x, y, z));
        let tiles = (camera.size / TILE as f32).ceil();
        Self { camera, view_from_world: Mat3::from_cols(x, y, z), swell, tiles }
    }

    /// The view-space place of a splat's or a block's centre.
    fn place(&self, centre: Vec3) -> Vec3 {
        self.view_from_world * (self.camera.origin + centre)
    }

    fn is_orthographic(&self) -> bool {
        self.camera.far > 0.0
    }

    /// First and last tile along an axis of boxes between `low` and `high` at depths of `near` to `far`; `None` beside the
    /// picture.
    fn range(&self, axis: usize, [low, high]: [f32; 2], [near, far]: [f32; 2]) -> Option<[f32; 2]> {
        let camera = self.camera;
        let [low, high] = match self.is_orthographic() {
            true => [low, high],
            false => [
                low / if low < 0.0 { near } else { far },
                high / if high < 0.0 { far } else { near },
            ],
        };
        let pixel = |at: f32| {
            let ndc = (at - camera.shift[axis]) / camera.tangent[axis];
            (if axis == 0 { ndc } else { -ndc } * 0.5 + 0.5) * camera.size[axis]
        };
        let first = pixel(low).min(pixel(high)) - Self::MARGIN;
        let last = pixel(low).max(pixel(high)) + Self::MARGIN;
        if !(last >= 0.0 && first <= camera.size[axis]) {
            return None;
        }
        let tile = |at: f32| (at / TILE as f32).floor().clamp(0.0, self.tiles[axis] - 1.0);
        Some([tile(first), tile(last)])
    }

    /// The tiles that a splat touches at most.
    fn tiles(&self, splat: &SplatData) -> u64 {
        let center = self.place(Vec3::from_array(splat.centre));
        let reach = self.swell * splat.reach();
        let depths = [-center.z - reach, -center.z + reach];
        let margin = 1e-5 * (center.length() + reach);
        if depths[1] + margin <= self.camera.near {
            return 0;
        }
        let is_cut = !self.is_orthographic() && depths[0] - margin <= self.camera.near;
        let along = |axis: usize| -> u64 {
            if is_cut {
                return self.tiles[axis] as u64;
            }
            let ends = [center[axis] - reach, center[axis] + reach];
            self.range(axis, ends, depths).map_or(0, |[first, last]| (last - first) as u64 + 1)
        };
        along(0) * along(1)
    }

    /// The tiles that any splat of a block touches at most; `None` if each should be looked at.
    fn tiles_of_each(&self, block: &Block) -> Option<u64> {
        let center = self.place(0.5 * (block.min + block.max));
        let half = 0.5 * (block.max - block.min);
        let half = self.view_from_world.abs() * half;
        let margin = 1e-5 * (center.length() + half.length() + block.reach);
        let reach = self.swell * block.reach + margin;
        let depths = [-center.z - half.z - reach, -center.z + half.z + reach];
        if depths[1] <= self.camera.near {
            return Some(0);
        }
        let nearest = -center.z - half.z;
        let is_far = nearest >= Self::DISTANT * (half.z + reach) && depths[0] > self.camera.near;
        // False for NaN.
        let is_alike = block.reach <= Self::ALIKE * block.mean_reach;
        if !(is_alike && (is_far || self.is_orthographic())) {
            return None;
        }
        let along = |axis: usize| -> u64 {
            let across = half[axis] + reach;
            let ends = [center[axis] - across, center[axis] + across];
            let Some([first, last]) = self.range(axis, ends, depths) else { return 0 };
            let width = match self.is_orthographic() {
                true => 2.0 * reach,
                // At x and depth z, (x + r) / (z - r) - (x - r) / (z + r); around x = 0, 2 r / (z - r).
                false => {
                    let x = (center[axis].abs() + half[axis]).max(reach);
                    2.0 * reach * (x + nearest) / ((nearest - reach) * (nearest + reach))
                }
            };
            let pixels = 0.5 * self.camera.size[axis] * width / self.camera.tangent[axis];
            let tiles = (1.001 * pixels + 2.0 * Self::MARGIN) / TILE as f32;
            (tiles as u64).saturating_add(2).min((last - first) as u64 + 1)
        };
        Some(along(0) * along(1))
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use glam::{DVec3, UVec2};

    use super::*;
    use crate::camera::Camera;
    use crate::liquid::blocks::Blocks;
    use crate::liquid::classify::Splats;

    /// Splats of differing sizes in a box, in the order of a grid's cells.
    fn cloud() -> Splats {
        let share = |i: usize, k: f64| (i as f64 * k).fract() as f32;
        let splat = |i: usize| {
            let cell = Vec3::from([i % 24, i / 24 % 24, i / 576].map(|i| i as f32));
            let jitter = Vec3::new(share(i, 0.618_034), share(i, 0.754_878), share(i, 0.569_840));
            let [a, b, c] = [0.3, 0.4, 0.5].map(|k| 0.02 + 0.03 * share(i, k + 0.0123));
            SplatData {
                centre: ((cell + jitter) / 24.0 - 0.5).to_array(),
                radius: 0.03,
                diagonal: [a, b, c],
                off_diagonal: [0.01 * share(i, 0.7), -0.01 * share(i, 0.9), 0.0],
                ..Zeroable::zeroed()
            }
        };
        let aggregates = (0..24 * 24 * 24).map(splat).collect();
        Splats { aggregates, radius: 0.03, ..Splats::default() }
    }

    /// Bounds by blocks are no less than their splats need, or lists would overflow, and not much more: blocks at the
    /// picture's edges count whole.
    #[test]
    fn blocks_bound_their_splats() {
        let splats = cloud();
        let blocks = Blocks::new(&splats);
        let eyes = [
            DVec3::new(0.0, 0.4, 2.0),
            DVec3::new(-4.0, 9.0, 7.0),
            DVec3::new(0.7, 0.1, 0.1),
            DVec3::ZERO,
        ];
        for eye in eyes {
            let target = DVec3::new(0.1, -0.2, -0.3);
            let camera = Camera { eye, target, up: Vec3::Y, fov_y: 40.0, near: None, lens: None };
            for (far, swell) in [(0.0, 1.0), (0.0, 1.3), (20.0, 1.3)] {
                let uniform = CameraUniform {
                    far,
                    shift: Vec2::new(0.2, -0.1),
                    ..camera.uniform(UVec2::new(320, 240), splats.origin)
                };
                let bound = most_entries(&splats.aggregates, &blocks.aggregates, &uniform, swell);
                let view = ScreenBounds::new(&uniform, swell);
                let exact: u64 = splats.aggregates.iter().map(|splat| view.tiles(splat)).sum();
                assert!(bound >= exact && bound <= 5 * exact, "{eye}: {bound} for {exact}");
                for (i, block) in blocks.aggregates.iter().enumerate() {
                    let of_block = &splats.aggregates[i * blocks::SIZE..][..blocks::SIZE];
                    let most = of_block.iter().map(|splat| view.tiles(splat)).max();
                    let each = view.tiles_of_each(block);
                    assert!(
                        each.is_none_or(|each| most <= Some(each)),
                        "{eye}: {most:?}, {each:?}"
                    );
                }
            }
        }
    }
}
