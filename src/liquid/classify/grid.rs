//! Neighbour search by a uniform grid: particles are sorted by cell, so that a row of cells is one
//! contiguous run of memory, and summed four at a time.
//!
//! Cells are as wide as the neighbourhood h of a particle of median radius. The candidates are gathered
//! once for all particles of a cell.

use std::ops::Range;

use glam::{DVec3, Mat4, UVec3, Vec3, Vec4};
use rayon::prelude::*;

use super::Member;
use super::moments::{EDGE, Moments};
use crate::liquid::counting_sort;

/// Largest ratio of a radius to the median or vice versa. Beyond it, too many cells would be visited,
/// or too many particles in each.
pub(super) const MAX_RADIUS_RATIO: f32 = 4.0;

/// Cell width in h. With up to [`MAX_CELLS_ALONG`] cells along an axis, rounding then moves no neighbour
/// beyond the adjacent cell.
const MARGIN: f64 = 1.002;
const MAX_CELLS_ALONG: f64 = 4096.0;

/// Cells for so many particles, at most.
fn most_cells(members: usize) -> f64 {
    8.0 * members as f64 + 4096.0
}

/// Placement of the cells. Particles outside the grid belong to the border cells, so that strays do not
/// enlarge it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layout {
    /// Minimum corner, m.
    pub(super) min: Vec3,
    /// Maximum corner, m.
    pub(super) max: Vec3,
    /// Inverse cell width, 1/m.
    pub(super) per_cell: f32,
    /// Cells along each axis.
    pub(super) counts: UVec3,
}

impl Layout {
    /// Chooses cells for members of this median radius, m, with a neighbourhood of `support` radii.
    /// Returns `None` if there are no members, if radii differ too much, or if nearly all cells would be
    /// empty.
    pub(super) fn of(members: &[Member], radius: f32, support: f32) -> Option<Self> {
        let similar = |m: &Member| {
            m.radius <= MAX_RADIUS_RATIO * radius && radius <= MAX_RADIUS_RATIO * m.radius
        };
        if members.is_empty() || !members.par_iter().all(similar) {
            return None;
        }
        let width = f64::from(support) * f64::from(radius) * MARGIN;
        let all = bounds(members);
        let fits = |counts: &DVec3| {
            counts.max_element() <= MAX_CELLS_ALONG
                && counts.element_product() <= most_cells(members.len())
        };
        let around = |(min, max): (Vec3, Vec3)| {
            let counts = ((max.as_dvec3() - min.as_dvec3()) / width).floor() + 1.0;
            let per_cell = (1.0 / width) as f32;
            fits(&counts).then(|| Self { min, max, per_cell, counts: counts.as_uvec3() })
        };
        around(all).or_else(|| around(bounds_of_most(members, all)))
    }

    /// As [`Layout::of`], for `count` particles in a known box. Where there would be too many cells, they are wider: also
    /// returns the ratio of their width to the usual one.
    pub(super) fn within(
        (min, max): (Vec3, Vec3),
        count: usize,
        radius: f32,
        support: f32,
    ) -> (Self, f64) {
        let usual = f64::from(support) * f64::from(radius) * MARGIN;
        let sides = max.as_dvec3() - min.as_dvec3();
        let counts = |width: f64| (sides / width).floor() + 1.0;
        let fits = |counts: DVec3| {
            counts.max_element() <= MAX_CELLS_ALONG && counts.element_product() <= most_cells(count)
        };
        let mut width = usual;
        while !fits(counts(width)) {
            width *= 1.5;
        }
        let layout =
            Self { min, max, per_cell: (1.0 / width) as f32, counts: counts(width).as_uvec3() };
        (layout, width / usual)
    }

    pub(super) fn cells(&self) -> usize {
        self.counts.element_product() as usize
    }

    pub(super) fn cell(&self, x: Vec3) -> UVec3 {
        let at = (x.clamp(self.min, self.max) - self.min) * self.per_cell;
        at.as_uvec3().min(self.counts - 1)
    }

    pub(super) fn index(&self, cell: UVec3) -> u32 {
        (cell.z * self.counts.y + cell.y) * self.counts.x + cell.x
    }

    /// The cell of an index.
    pub(super) fn cell_at(&self, index: usize) -> UVec3 {
        let UVec3 { x, y, .. } = self.counts;
        let index = index as u32;
        UVec3::new(index % x, index / x % y, index / (x * y))
    }

    /// Largest distance in cells of a neighbour within h.
    pub(super) fn reach(&self, h: f32) -> u32 {
        (h * self.per_cell).ceil() as u32
    }
}

fn bounds(members: &[Member]) -> (Vec3, Vec3) {
    let join = |a: (Vec3, Vec3), b: (Vec3, Vec3)| (a.0.min(b.0), a.1.max(b.1));
    let nothing = || (Vec3::INFINITY, Vec3::NEG_INFINITY);
    members.par_iter().map(|m| (m.position(), m.position())).reduce(nothing, join)
}

/// Part of the bounding box that contains nearly all members: along each axis the range of the middle 31
/// of 32, extended by its own length to both sides.
fn bounds_of_most(members: &[Member], (min, max): (Vec3, Vec3)) -> (Vec3, Vec3) {
    const SAMPLES: usize = 4096;
    let step = members.len().div_ceil(SAMPLES);
    let along = |axis: usize| {
        let sample = members.iter().step_by(step).map(|m| f64::from(m.position[axis]));
        let mut sorted: Vec<_> = sample.collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let few = sorted.len() / 64;
        let (low, high) = (sorted[few], sorted[sorted.len() - 1 - few]);
        let (least, most) = (2.0 * low - high, 2.0 * high - low);
        (least.max(min[axis].into()) as f32, most.min(max[axis].into()) as f32)
    };
    let [x, y, z] = [0, 1, 2].map(along);
    (Vec3::new(x.0, y.0, z.0), Vec3::new(x.1, y.1, z.1))
}

/// Largest number of particles per cell, averaged over particles; more are a crowd. At rest it is
/// (support / 2)³.
pub(super) fn most_shared(support: f32) -> f64 {
    64.0 + 8.0 * (f64::from(support) / 2.0).powi(3)
}

/// The members of a cloud, sorted by cell.
pub(super) struct Grid<'a> {
    members: &'a [Member],
    layout: Layout,
    /// Median radius, m.
    radius: f32,
    support: f32,
    /// First sorted index of each cell, and the end of the last one.
    starts: Vec<u32>,
    /// Member indices in sorted order.
    order: Vec<u32>,
    /// Positions in sorted order, and volumes relative to that of the median radius.
    sorted: Vec<Vec4>,
}

impl<'a> Grid<'a> {
    /// Sorts the members. Returns `None` for crowds, for which the tree is faster because it can sample
    /// them.
    pub(super) fn new(
        layout: Layout,
        members: &'a [Member],
        radius: f32,
        support: f32,
    ) -> Option<Self> {
        let grid = Self::sort(layout, members, radius, support);
        let squares: f64 = grid.starts.windows(2).map(|w| f64::from(w[1] - w[0]).powi(2)).sum();
        let crowd = squares / members.len() as f64;
        (crowd <= most_shared(support)).then_some(grid)
    }

    /// As [`Grid::new`], for crowds too.
    fn sort(layout: Layout, members: &'a [Member], radius: f32, support: f32) -> Self {
        let cells: Vec<u32> =
            members.par_iter().map(|m| layout.index(layout.cell(m.position()))).collect();
        let (mut starts, mut order) = (Vec::new(), Vec::new());
        counting_sort::by_cell(&cells, layout.cells(), &mut starts, &mut order);
        drop(cells);
        let place = |&i: &u32| {
            let member = &members[i as usize];
            member.position().extend((member.radius / radius).powi(3))
        };
        let sorted = order.par_iter().map(place).collect();
        Self { members, layout, radius, support, starts, order, sorted }
    }

    /// Sorts other members into the same cells.
    pub(super) fn like<'b>(&self, members: &'b [Member]) -> Grid<'b> {
        Grid::sort(self.layout, members, self.radius, self.support)
    }

    /// Maps the members of these sorted indices, each with its moments, through `act`.
    pub(super) fn map<T: Send>(
        &self,
        slots: &[u32],
        act: impl Fn(&Member, &Moments) -> T + Sync,
    ) -> Vec<T> {
        slots
            .par_iter()
            .with_min_len(256)
            .map_init(Block::default, |block, &slot| {
                let slot = slot as usize;
                let member = &self.members[self.order[slot] as usize];
                let h = self.support * member.radius;
                block.gather(self, member.position(), self.layout.reach(h));
                act(member, &block.moments(self.sorted[slot], 1.0 / h))
            })
            .collect()
    }

    /// Maps the members of the marked cells, in sorted order, through `act`, which is given the member's position
    /// and relative volume, the inverse of its neighbourhood of `support` radii, and the candidates in packets.
    /// Other members have the default.
    pub(super) fn map_marked<T: Default + Send>(
        &self,
        marked: &[bool],
        support: f32,
        act: impl Fn(Vec4, f32, &[Mat4]) -> T + Sync,
    ) -> Vec<T> {
        (0..self.order.len())
            .into_par_iter()
            .with_min_len(256)
            .map_init(Block::default, |block, slot| {
                let member = &self.members[self.order[slot] as usize];
                if !marked[self.layout.index(self.layout.cell(member.position())) as usize] {
                    return T::default();
                }
                let h = support * member.radius;
                block.gather(self, member.position(), self.layout.reach(h));
                act(self.sorted[slot], 1.0 / h, &block.packets)
            })
            .collect()
    }

    /// The cells that a box meets, as their indices.
    pub(super) fn cells_of(&self, low: Vec3, high: Vec3) -> impl Iterator<Item = Range<u32>> {
        let (first, last) = (self.layout.cell(low), self.layout.cell(high));
        let row = move |y, z| {
            self.layout.index(UVec3::new(first.x, y, z))
                ..self.layout.index(UVec3::new(last.x, y, z)) + 1
        };
        (first.z..=last.z).flat_map(move |z| (first.y..=last.y).map(move |y| row(y, z)))
    }

    /// The sorted indices of the members in the cells that a box meets: of all that are in the box, and others.
    pub(super) fn slots_of(&self, low: Vec3, high: Vec3) -> impl Iterator<Item = Range<usize>> {
        let start = |cell: u32| self.starts[cell as usize] as usize;
        self.cells_of(low, high).map(move |cells| start(cells.start)..start(cells.end))
    }

    /// The positions of members by their sorted indices, m, and their volumes relative to that of a particle of
    /// [`Grid::radius`].
    pub(super) fn places(&self, slots: Range<usize>) -> &[Vec4] {
        &self.sorted[slots]
    }

    /// Median radius of the members, m.
    pub(super) fn radius(&self) -> f32 {
        self.radius
    }

    /// Number of cells.
    pub(super) fn cells(&self) -> usize {
        self.layout.cells()
    }

    /// Index of each member, in sorted order.
    pub(super) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Radius of the neighbourhoods, in particle radii.
    pub(super) fn support(&self) -> f32 {
        self.support
    }

    /// The placement of the cells.
    pub(super) fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The sorted indices of a cell's members.
    pub(super) fn of_cell(&self, cell: usize) -> Range<u32> {
        self.starts[cell]..self.starts[cell + 1]
    }

    /// The sorted indices of the members outside of the marked cells.
    pub(super) fn slots_outside(&self, marked: Option<&[bool]>) -> Vec<u32> {
        match marked {
            None => (0..self.order.len() as u32).collect(),
            Some(marked) => {
                let cells = marked.iter().enumerate().filter(|(_, marked)| !**marked);
                cells.flat_map(|(cell, _)| self.of_cell(cell)).collect()
            }
        }
    }

    /// For each member its place among these sorted indices, or [`u32::MAX`].
    pub(super) fn ranks(&self, slots: &[u32]) -> Vec<u32> {
        let mut ranks = vec![u32::MAX; self.order.len()];
        for (rank, &slot) in (0..).zip(slots) {
            ranks[self.order[slot as usize] as usize] = rank;
        }
        ranks
    }
}

/// Candidate neighbours: the members of a cell and of the cells around it.
#[derive(Default)]
struct Block {
    /// The cell and the reach for which the candidates were gathered.
    of: Option<(UVec3, u32)>,
    near: Vec<Vec4>,
    /// The candidates transposed in groups of four: x, y, z and volume.
    packets: Vec<Mat4>,
}

impl Block {
    /// Gathers the candidates around a position, unless they are those of the last call.
    fn gather(&mut self, grid: &Grid<'_>, at: Vec3, reach: u32) {
        let layout = &grid.layout;
        let cell = layout.cell(at);
        if self.of == Some((cell, reach)) {
            return;
        }
        self.of = Some((cell, reach));
        self.near.clear();
        let first = cell.saturating_sub(UVec3::splat(reach));
        let last = (cell + reach).min(layout.counts - 1);
        for z in first.z..=last.z {
            for y in first.y..=last.y {
                let begin = grid.starts[layout.index(UVec3::new(first.x, y, z)) as usize];
                let end = grid.starts[layout.index(UVec3::new(last.x, y, z)) as usize + 1];
                self.near.extend_from_slice(&grid.sorted[begin as usize..end as usize]);
            }
        }
        // Infinitely far and without volume.
        let padding = Vec3::INFINITY.extend(0.0);
        self.near.resize(self.near.len().next_multiple_of(4), padding);
        self.packets.clear();
        let packets = self.near.chunks_exact(4);
        self.packets.extend(packets.map(|v| Mat4::from_cols(v[0], v[1], v[2], v[3]).transpose()));
    }

    /// Computes the moments around the member whose position and volume are `own`.
    fn moments(&self, own: Vec4, per_h: f32) -> Moments {
        const WITHIN: Vec4 = Vec4::splat((EDGE * EDGE) as f32);
        let from = [own.x, own.y, own.z].map(Vec4::splat);
        let mut sums = [Vec4::ZERO; 11];
        for packet in &self.packets {
            let x = (packet.x_axis - from[0]) * per_h;
            let y = (packet.y_axis - from[1]) * per_h;
            let z = (packet.z_axis - from[2]) * per_h;
            let square = x * x + y * y + z * z;
            // Masks candidates beyond h: an infinite offset times a zero weight would be NaN.
            let within = square.cmple(WITHIN);
            let [one, x, y, z] = [Vec4::ONE, x, y, z].map(|v| Vec4::select(within, v, Vec4::ZERO));
            let w = packet.w_axis * (Vec4::ONE - square * square.sqrt()).max(Vec4::ZERO);
            let (wx, wy, wz) = (w * x, w * y, w * z);
            let terms = [one, w, wx, wy, wz, wx * x, wy * y, wz * z, wx * y, wx * z, wy * z];
            for (sum, term) in sums.iter_mut().zip(terms) {
                *sum += term;
            }
        }
        let [count, sums @ ..] = sums.map(|sum| sum.as_dvec4().element_sum());
        let [weight, x, y, z, xx, yy, zz, xy, xz, yz] = sums.map(|sum| sum / f64::from(own.w));
        Moments {
            count: count as u32,
            weight,
            first: DVec3::new(x, y, z),
            diagonal: DVec3::new(xx, yy, zz),
            off_diagonal: DVec3::new(xy, xz, yz),
        }
    }
}
