//! Classification on the device: `shaders/classify/`.
//!
//! A counting sort builds the same uniform grid as on the CPU (`device/kernels.rs` has the order of the steps). Then one thread
//! per member sums over its neighbours, finds the eigenvectors of their covariance by Jacobi rotations, and writes the
//! member's splat. Splats at the surface are moved to the iso-surface, and cells deep inside of large bodies become one
//! splat each. Within a cell members keep file order, so that the result does not depend on scheduling.
//!
//! Sums have 32 bits, relative to the member and in units of h. Compared with the tree's 64-bit sums,
//! centres and axes are within 10⁻⁴ r, and the class differs only where the density is within 10⁻⁵ of
//! the threshold. Centres of splats that are moved are within 10⁻³ r, except for the few where an iso-surface is only
//! just found or not.

mod buffers;
mod kernels;
mod splats;

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use rayon::prelude::*;

use super::grid::{self, Layout};
use super::{Cloud, Splat, Splats, interior, iso_surface, moments};
use crate::error::{Error, Limited, Result};
use crate::gpu::{self, Gpu};
use crate::liquid::device_particles::DeviceParticles;
#[cfg(not(target_arch = "wasm32"))]
use crate::liquid::particles::Particles;
use crate::scene::{Scene, Shape, Solid};
use crate::settings::{Classify, Kernel};
use buffers::{Buffers, Capacity};
pub use splats::DeviceSplats;

/// Workgroup size of the sorting kernels, as in the shaders.
pub const SORTING: u32 = 256;
/// Cells per block of the prefix sum, as in `classify/sums.wgsl`.
pub const BLOCK: u32 = 2048;
/// Bit of the tags of a member whose shape the host knows, as in `classify/shape.wgsl`.
pub const GIVEN: u32 = 1 << 31;

/// How far a splat may move to the iso-surface, and how much longer its axes may become, in r.
const FARTHEST: f32 = 4.0;
const LONGER: f32 = 4.0;

/// Largest size of a frame's splats, bytes, at which its buffers are kept for the next frame.
const KEPT: u64 = 256 << 20;

/// `Params` of `shaders/classify/params.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Params {
    /// Minimum corner of the grid, m.
    pub least: [f32; 3],
    /// Inverse cell width, 1/m.
    pub per_cell: f32,
    /// Maximum corner of the grid, m.
    pub greatest: [f32; 3],
    /// Number of members.
    pub members: u32,
    /// Cells along each axis.
    pub counts: [u32; 3],
    /// Number of cells.
    pub cells: u32,
    /// Origin of the splats relative to that of the members, m.
    pub shift: [f32; 3],
    /// Sum of the squared cell counts, which the device fills in.
    pub squares: f32,
    /// Neighbourhood radius h, in r.
    pub support: f32,
    /// Summed weight below which a member is a splash.
    pub least_weight: f32,
    /// Summed weight inside a body at rest.
    pub density_at_rest: f32,
    /// `k_r`.
    pub max_ratio: f32,
    /// 1 for [`Kernel::Volume`].
    pub volume_kernel: u32,
    /// Short semi-axis of fitted kernels, in r.
    pub short_axis: f32,
    /// Longest semi-axis of fitted kernels, in r.
    pub long_axis: f32,
    /// Radius of a splash, in r.
    pub splash_radius: f32,
    /// Sum of the squared cell counts above which the members are a crowd.
    pub most_squares: f32,
    /// How far centres move towards the mean of the neighbours.
    pub smoothing: f32,
    /// Neighbours, at most, of a member whose splat may be moved to the iso-surface; 0 if none is.
    pub most_neighbours: u32,
    /// Largest radius of a member, m.
    pub largest_radius: f32,
    /// Members in 2×2×2 cells inside a body, at least; 0 if no cell is merged.
    pub full: f32,
    /// Members in each of them, at least.
    pub full_cell: f32,
    /// Lines on which the iso-surface is looked for, at most.
    pub most_lines: u32,
    /// 1 if each member has its tags, 0 for one for all.
    pub tagged: u32,
    /// Distance from a solid within which bodies wet it, in r.
    pub wetting: f32,
    /// Copies of splats on solids, at most.
    pub most_copies: u32,
    /// Padding to a multiple of 16 bytes.
    pub pad: [u32; 2],
}

/// `Sum` of `shaders/classify/sums.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Sum {
    /// Items in a block of cells; after the scan, items in all preceding blocks.
    pub count: u32,
    /// Sum of the squared cell counts.
    pub squares: f32,
}

/// Classification on a device. Threads may share it; it serves one call at a time.
#[derive(Debug)]
pub struct Classifier {
    gpu: Gpu,
    /// Buffers of the largest frame so far.
    buffers: Mutex<Option<Buffers>>,
    /// Number of frames that stayed on the device.
    generation: AtomicU64,
}

impl Classifier {
    /// A classifier on this device.
    ///
    /// # Errors
    /// [`Error::Limit`] if the device has less than WebGPU's default limits for compute shaders.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let limits = gpu.device.limits();
        let enough = limits.max_storage_buffers_per_shader_stage >= 8
            && limits.max_compute_invocations_per_workgroup >= SORTING
            && limits.max_compute_workgroup_size_x >= SORTING
            && limits.max_compute_workgroup_storage_size >= 2 * 4 * SORTING
            && limits.max_compute_workgroups_per_dimension >= gpu::ROW;
        if !enough {
            let problem = "cannot classify: its limits for compute shaders are below WebGPU's";
            return Err(Error::Limit {
                adapter: gpu.adapter(),
                problem: problem.into(),
                of: Limited::Classify,
            });
        }
        Ok(Self { gpu: gpu.clone(), buffers: Mutex::default(), generation: AtomicU64::new(0) })
    }

    /// As [`super::classify`], on the device.
    ///
    /// Falls back to the CPU for frames without a grid ([`Cloud::has_grid`]) and for frames that exceed
    /// the device's limits: at 48 bytes per particle in one binding, 128 MiB hold 2.8 million.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn classify(
        &self,
        particles: &Particles,
        default_radius: f32,
        settings: &Classify,
    ) -> Result<Splats> {
        self.classify_cloud(&Cloud::new(particles, default_radius), settings)
    }

    /// As [`Classifier::classify`].
    ///
    /// # Errors
    /// As [`Gpu::check`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn classify_cloud(&self, cloud: &Cloud, settings: &Classify) -> Result<Splats> {
        pollster::block_on(self.finish(cloud, settings))
    }

    /// As [`Classifier::classify_cloud`], for clouds that the device can classify; `None` for others.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    #[cfg(not(target_arch = "wasm32"))]
    pub fn classify_on_device(&self, cloud: &Cloud, settings: &Classify) -> Result<Option<Splats>> {
        pollster::block_on(self.finish_on_device(cloud, settings))
    }

    /// Records the classification of particles on the device into the caller's encoder. The splats stay there, and
    /// [`FrameInput`](crate::frame::FrameInput) takes them like any others. Submits, waits for and maps nothing.
    ///
    /// The splats last until the classifier's next frame, in whatever way that is classified: draw one before the next. All
    /// particles are of the scene's first fluid. Crowds, for which there is no time to look at all neighbours, become spheres.
    /// Bodies wet the scene's solids, as by [`super::add_wall_contacts`], but not its meshes; there is room for one copy of
    /// each splat. Three things that the host does for its own splats are missing here: splats may show through thin solids;
    /// light views frame the whole bounds, without regard to a level surface or a lamp in the liquid; and light that reaches
    /// an eye in the liquid is not absorbed on its way down.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the buffers do not hold the particles, or the scene cannot be drawn; [`Error::Limit`] if a binding
    /// of the device holds neither the part of a buffer with the particles nor their splats, 48 bytes each.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        particles: &DeviceParticles<'_>,
        scene: &Scene,
    ) -> Result<Splats> {
        scene.check()?;
        particles.check()?;
        let settings = &scene.settings.classify;
        let walls = walls(scene, particles.origin);
        let &DeviceParticles { count, radius, radii, origin, bounds, .. } = particles;
        let (min, max) = (bounds.0 - origin, bounds.1 - origin);
        let members = count as usize;
        let in_32_bits = (min.as_vec3(), max.as_vec3());
        let (layout, wider) = Layout::within(in_32_bits, members, radius, settings.support);
        if count == 0 {
            return Ok(Splats { radius, origin, ..Splats::default() });
        }
        let most = self.gpu.most_binding();
        let limit = |problem: String| Error::Limit {
            adapter: self.gpu.adapter(),
            problem,
            of: Limited::Classify,
        };
        let (positions, radii_part, _) = particles.parts(&self.gpu);
        for part in [Some(positions), radii_part].into_iter().flatten() {
            let (name, bytes) = (part.name, part.bytes);
            if bytes > most {
                return Err(limit(format!("{name} take {bytes} bytes; a binding holds {most}")));
            }
        }
        let copies = if walls.is_empty() { 0 } else { members };
        let wanted = Capacity::for_frame(&self.gpu, [members, copies], &layout, settings);
        let Some(wanted) = wanted else {
            let cells = layout.cells();
            return Err(limit(format!(
                "the splats of {count} particles in {cells} cells exceed a binding, which holds {most} bytes"
            )));
        };
        let mut params = Params::new(&layout, members, settings, wanted.lines);
        params.largest_radius = match radii {
            Some(_) => grid::MAX_RADIUS_RATIO * radius,
            None => radius,
        };
        params.most_copies = copies as u32;
        // Wider cells have more members each.
        params.most_squares *= wider.powi(3) as f32;
        // How many particles there are of those that there may be, only the device knows.
        let counted = particles.counter.is_none();
        if wider == 1.0 && counted && radii.is_none() && interior::merges(members, settings) {
            params.merge_cells(settings);
        }

        let mut kept = self.buffers.lock().unwrap_or_else(PoisonError::into_inner);
        let buffers = match kept.take() {
            Some(old) if old.capacity.holds(wanted) => old,
            old => {
                let most = old.map_or(wanted, |old| old.capacity.max(wanted));
                Buffers::allocate(&self.gpu, most)
            }
        };
        kernels::gather(&self.gpu, encoder, &buffers, &params, particles);
        kernels::record(&self.gpu, encoder, &buffers, &params, &walls);
        let splats = buffers.splats.clone();
        *kept = Some(buffers);
        drop(kept);

        let largest = params.largest_radius;
        // The longest semi-axis of a splat, or the radius of a merged cell's sphere.
        let sphere = if params.full > 0.0 { 0.5 * 3.0f32.sqrt() / layout.per_cell } else { 0.0 };
        let axes = settings.long_axis.max(settings.short_axis).max(settings.splash_radius);
        let reach = (largest * (axes + LONGER)).max(sphere);
        let moved = settings.smoothing * settings.support + FARTHEST + settings.wetting;
        let moved = f64::from(largest * moved);
        Ok(Splats {
            radius,
            origin,
            device: Some(DeviceSplats {
                buffer: splats,
                count: count + params.most_copies,
                members: count,
                bounds: (min - DVec3::splat(moved), max + DVec3::splat(moved)),
                reach,
                usual_reach: radius * axes,
                has_splashes: settings.splash_density > 0.0,
                radii_differ: radii.is_some(),
                generation: self.generation.fetch_add(1, Ordering::Relaxed),
            }),
            ..Splats::default()
        })
    }

    /// As `Classifier::classify_cloud`, for code that browsers and other programs share: waiting yields in a browser
    /// and blocks elsewhere.
    ///
    /// # Errors
    /// As [`Gpu::check`].
    pub async fn finish(&self, cloud: &Cloud, settings: &Classify) -> Result<Splats> {
        let on_device = self.finish_on_device(cloud, settings).await?;
        Ok(on_device.unwrap_or_else(|| cloud.classify(settings)))
    }

    /// As `Classifier::classify_on_device`; waits as [`Classifier::finish`].
    #[expect(
        clippy::await_holding_lock,
        reason = "outside of browsers nothing is awaited, and in one a single task classifies at a time"
    )]
    async fn finish_on_device(&self, cloud: &Cloud, settings: &Classify) -> Result<Option<Splats>> {
        let Some(layout) = Layout::of(&cloud.members, cloud.radius, settings.support) else {
            return Ok(None);
        };
        let members = [cloud.members.len(), 0];
        let Some(wanted) = Capacity::for_frame(&self.gpu, members, &layout, settings) else {
            return Ok(None);
        };
        let (places, tags) = (cloud.places(), cloud.tags());
        let mut params = Params::new(&layout, cloud.members.len(), settings, wanted.lines);
        params.shift = cloud.shift.as_vec3().to_array();
        params.tagged = u32::from(tags.len() > 1);
        params.largest_radius = cloud.members.par_iter().map(|m| m.radius).reduce(|| 0.0, f32::max);
        if cloud.has_interior(settings) {
            params.merge_cells(settings);
        }

        // No rayon call while this is locked: it might run another task that locks it too.
        let mut kept = self.buffers.lock().unwrap_or_else(PoisonError::into_inner);
        let buffers = match kept.take() {
            Some(old) if old.capacity.holds(wanted) => Some(old),
            old => {
                let most = old.map_or(wanted, |old| old.capacity.max(wanted));
                Buffers::new(&self.gpu, most).await
            }
        };
        let Some(mut buffers) = buffers else { return Ok(None) };
        buffers.upload(&self.gpu, &places, &tags);
        let staging = buffers.staging(&self.gpu);
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        kernels::record(&self.gpu, &mut encoder, &buffers, &params, &[]);
        let (sum, splat) = (size_of::<Sum>() as u64, size_of::<Splat>() as u64);
        encoder.copy_buffer_to_buffer(&buffers.total, 0, &staging, 0, sum);
        let splats = splat * wanted.members;
        encoder.copy_buffer_to_buffer(&buffers.splats, 0, &staging, sum, splats);
        let submission = self.gpu.queue.submit([encoder.finish()]);
        let bytes = sum + splats;
        let (found, all) = gpu::read_mapped(&self.gpu, &staging, bytes, submission, |b| {
            let (all, splats) = b.split_at(size_of::<Sum>());
            let all: Sum = bytemuck::pod_read_unaligned(all);
            (bytemuck::pod_collect_to_vec::<u8, Splat>(splats), all)
        })
        .await?;
        // Large buffers are released, for drawing needs device memory too.
        let each = size_of::<Splat>() as u64;
        *kept = Some(buffers).filter(|buffers| buffers.capacity.members * each <= KEPT);
        drop(kept);
        let is_crowd = all.squares > params.most_squares;
        Ok((!is_crowd).then(|| cloud.splats_from_device(found)))
    }
}

/// `Wall` of `shaders/classify/walls.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Wall {
    /// Relative to the splats' origin, m.
    pub middle: [f32; 3],
    /// Of a plane 0, of a box 1, of a sphere 2.
    pub kind: u32,
    /// Of a plane the normal, of a box half its sides, m.
    pub extent: [f32; 3],
    /// Of a plane half the side of its square, of a sphere the radius, m.
    pub size: f32,
    /// Tags of copies on a plane.
    pub tags: u32,
    /// Further tags of those behind it.
    pub behind: u32,
    /// Padding.
    pub pad: [u32; 2],
}

/// The solids of a scene that splats around `origin` can wet on the device: all but meshes.
fn walls(scene: &Scene, origin: DVec3) -> Vec<Wall> {
    if scene.settings.classify.wetting == 0.0 {
        return Vec::new();
    }
    let place = |x: DVec3| (x - origin).as_vec3().to_array();
    let wall = |(number, solid): (u32, &Solid)| {
        let none = Wall::zeroed();
        match solid.shape {
            Shape::Mesh { .. } => None,
            Shape::Plane { origin, normal, half_extent } => Some(Wall {
                middle: place(origin),
                extent: normal.to_array(),
                size: half_extent.min(f32::MAX),
                tags: number << Splat::WALL,
                behind: Splat::WALL_FROM_BEHIND,
                ..none
            }),
            Shape::Box { min, max } => {
                let half = (0.5 * (max - min)).as_vec3().to_array();
                Some(Wall { middle: place(0.5 * (min + max)), kind: 1, extent: half, ..none })
            }
            Shape::Sphere { center, radius } => {
                Some(Wall { middle: place(center), kind: 2, size: radius, ..none })
            }
        }
    };
    (1..).zip(&scene.solids).filter_map(wall).collect()
}

impl Params {
    /// Parameters for untagged members of the grid's radius, around the splats' origin.
    fn new(layout: &Layout, members: usize, settings: &Classify, most_lines: u64) -> Self {
        let at_rest = moments::density_at_rest(settings.support.into());
        let crowd = grid::most_shared(settings.support) * members as f64;
        Self {
            least: layout.min.to_array(),
            per_cell: layout.per_cell,
            greatest: layout.max.to_array(),
            members: members as u32,
            counts: layout.counts.to_array(),
            cells: layout.cells() as u32,
            support: settings.support,
            least_weight: (f64::from(settings.splash_density) * at_rest) as f32,
            density_at_rest: at_rest as f32,
            max_ratio: settings.max_ratio.max(1.0),
            volume_kernel: u32::from(settings.kernel == Kernel::Volume),
            short_axis: settings.short_axis,
            long_axis: settings.long_axis,
            splash_radius: settings.splash_radius,
            most_squares: crowd as f32,
            smoothing: settings.smoothing,
            most_neighbours: match iso_surface::refines(settings) {
                true => iso_surface::most_neighbours(settings.support) as u32,
                false => 0,
            },
            most_lines: most_lines as u32,
            wetting: settings.wetting,
            ..Zeroable::zeroed()
        }
    }

    /// Gives the members of cells deep inside bodies one splat.
    fn merge_cells(&mut self, settings: &Classify) {
        [self.full, self.full_cell] = interior::full_cells(settings.support).map(|n| n as f32);
    }
}

impl Cloud {
    /// Position and radius of each member, m.
    fn places(&self) -> Vec<[f32; 4]> {
        let place = |m: &super::Member| [m.position[0], m.position[1], m.position[2], m.radius];
        self.members.par_iter().map(place).collect()
    }

    /// The tags of each member, or one for all.
    fn tags(&self) -> Vec<u32> {
        let first = self.members.first().map_or(0, |m| m.fluid);
        if self.ellipsoids.is_none() && self.members.par_iter().all(|m| m.fluid == first) {
            return vec![first];
        }
        let given = |m: &super::Member| if self.given(m).is_some() { GIVEN } else { 0 };
        self.members.par_iter().map(|m| m.fluid | given(m)).collect()
    }

    /// Sorts the device's splats, one for each member, by class. Shapes from the file replace computed ones.
    fn splats_from_device(&self, found: Vec<Splat>) -> Splats {
        let (mut aggregates, mut splashes, mut spheres) = (Vec::new(), Vec::new(), Vec::new());
        for (member, mut splat) in self.members.iter().zip(found) {
            let tags = splat.tags;
            splat.particle = member.particle;
            splat.tags &= !Splat::SPLASH;
            if tags & Splat::HIDDEN != 0 {
                continue;
            }
            if tags & Splat::SPLASH != 0 {
                splashes.push(splat);
            } else if splat.is_interior() {
                spheres.push(splat);
            } else if let Some(ellipsoid) = self.given(member) {
                aggregates.push(member.given(ellipsoid, self.shift).buried(splat.is_buried()));
            } else {
                aggregates.push(splat);
            }
        }
        aggregates.append(&mut spheres);
        self.frame(aggregates, splashes)
    }
}
