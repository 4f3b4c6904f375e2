//! A budget for each pass of a frame: the bytes that it must move, the operations that it must
//! perform, the time that these need at the adapter's peak rates, and the measured time.
//!
//! The floor of a pass is the longer of two times: that of its bytes at the adapter's copy rate,
//! and that of its operations at the adapter's multiply-add rate. It counts what the method
//! requires, not what the shader does: a texel read by several threads counts once, fragments
//! outside their ellipsoids are free, a cube root costs no more than on paper. No pass reaches its
//! floor; passes far from it are worth optimizing.

use glam::{DMat3, DVec2, DVec3, IVec2, UVec2, Vec3};
use serde::Serialize;

use super::picture;
use super::rates::Rates;
use super::rows::median;
use super::subjects;
use limpid::camera::{Camera, CameraUniform};
use limpid::frame::FrameInput;
use limpid::gpu::Gpu;
use limpid::gpu::TILE;
use limpid::lights;
use limpid::liquid::classify::{Splat, Splats};
use limpid::offscreen::Picture;
use limpid::passes::caustics;
use limpid::renderer::Renderer;
use limpid::scene::Scene;
use limpid::settings::Method;
use limpid_io::error::Result;

/// One pass's budget in one frame.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Budget {
    /// The scene: a name of `sims/`.
    pub scene: String,
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// The pass, as in the times, or a sum over passes.
    pub pass: String,
    /// Bytes that must be read or written.
    pub bytes: f64,
    /// Operations on 32-bit floats that must be done.
    pub operations: f64,
    /// Time of these at the measured rates, ms: the longer of the two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub floor_ms: Option<f64>,
    /// Median of the measured times, ms.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ms: Option<f64>,
}

impl Budget {
    /// Measured time over floor.
    pub fn ratio(&self) -> Option<f64> {
        self.floor_ms.filter(|&floor| floor > 0.0).zip(self.ms).map(|(floor, ms)| ms / floor)
    }
}

/// Quantities of a view that the work of passes is counted in.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Counts {
    /// Pixels of the view.
    pub pixels: f64,
    /// Tiles of the view, and those with liquid.
    pub tiles: f64,
    /// See `tiles`.
    pub liquid_tiles: f64,
    /// Rendered classes of particles: 1, or 2 with splashes.
    pub classes: f64,
    /// Rendered sides of each class: 1, or 2 with backs.
    pub sides: f64,
    /// Number of aggregates, the sum of the pixels that each covers, and the pixels that any
    /// covers.
    pub aggregates: f64,
    /// See `aggregates`.
    pub aggregate_fragments: f64,
    /// See `aggregates`.
    pub aggregate_pixels: f64,
    /// The same for splashes.
    pub splashes: f64,
    /// See `splashes`.
    pub splash_fragments: f64,
    /// See `splashes`.
    pub splash_pixels: f64,
    /// Pixels covered by either class.
    pub liquid_pixels: f64,
    /// Iterations of the smoothing, and samples per iteration.
    pub iterations: f64,
    /// See `iterations`.
    pub taps: f64,
    /// Solids and lights of the scene.
    pub solids: f64,
    /// See `solids`; 0 where nothing is lit.
    pub lights: f64,
    /// Rays through pixels with liquid; the interfaces that they cross and the layers that they
    /// evaluate, in total.
    pub rays: f64,
    /// See `rays`.
    pub interfaces: f64,
    /// See `rays`.
    pub evaluations: f64,
    /// Rays through pixels without liquid, in total.
    pub background_rays: f64,
    /// Of a light's view: vertices of its grid, subdivided cells, interfaces that light is traced
    /// through.
    pub vertices: f64,
    /// See `vertices`.
    pub parts: f64,
    /// See `vertices`.
    pub light_interfaces: f64,
    /// 1 if light is splatted forward, and 1 if it is gathered.
    pub forward: f64,
    /// See `forward`.
    pub gather: f64,
    /// 1 if the map is blurred.
    pub blurred: f64,
}

impl Counts {
    /// Texels of the aggregate layers with liquid.
    fn texels(&self) -> f64 {
        self.sides * self.aggregate_pixels
    }

    /// Intersections with all solids: one per ray, and those of the reflected and refracted rays of
    /// each interface.
    fn solid_traces(&self) -> f64 {
        self.rays + 2.0 * self.interfaces + self.background_rays
    }
}

/// Work of a pass: its name, the number of repetitions, bytes and operations of each.
struct Work(&'static str, fn(&Counts) -> f64, f64, f64);

/// The cost model. A plane is 16 bytes, a splat 48, as in the shaders. Operations are counted from
/// the shaders: an addition, multiplication or comparison is one; a division, root or exponential
/// four.
const MODEL: [Work; 47] = [
    // Each splat is read, bounded and placed once; each of its pixels is intersected for both sides at
    // once. Each texel is written once, with the plane of the splat that was found.
    Work("splat", |c| c.aggregates, 48.0 + 64.0, 300.0),
    Work("splat", |c| c.aggregate_fragments, 0.0, 60.0),
    Work("splat", |c| c.sides * c.pixels, 16.0, 0.0),
    Work("splat", |c| c.texels(), 0.0, 60.0),
    Work("splat splashes", |c| c.splashes, 48.0 + 64.0, 300.0),
    Work("splat splashes", |c| c.splash_fragments, 0.0, 60.0),
    Work("splat splashes", |c| c.sides * c.pixels, 16.0, 0.0),
    Work("splat splashes", |c| c.sides * c.splash_pixels, 0.0, 60.0),
    // Each splat is read once; each of its pixels adds to four sums.
    Work("mixture", |c| c.aggregates + c.splashes, 48.0, 0.0),
    Work("mixture", |c| c.aggregate_fragments + c.splash_fragments, 0.0, 60.0),
    Work("mixture", |c| c.pixels, 8.0, 0.0),
    // Each splat is read once, and marks a word of each cell of 4 × 4 pixels; cells are read once. How many
    // pixels have gaps is not counted.
    Work("gaps", |c| c.aggregates + c.splashes, 48.0, 0.0),
    Work("gaps", |c| (c.aggregate_fragments + c.splash_fragments) / 16.0, 0.0, 90.0),
    Work("gaps", |c| c.classes * c.pixels / 16.0, 8.0, 4.0),
    Work("smooth gaps", |c| c.tiles, 4.0, 0.0),
    // One texel suffices to detect a tile with liquid; a tile without liquid needs all of them.
    Work("tiles", |c| c.classes * c.liquid_tiles, 16.0, 1.0),
    Work("tiles", |c| c.classes * (c.tiles - c.liquid_tiles), 16.0 * 64.0, 64.0),
    Work("tiles", |c| c.tiles, 4.0, 4.0),
    // Each iteration reads and writes a state; one more pass converts it to planes.
    Work("smooth", |c| c.texels() * (c.iterations + 1.0), 32.0, 60.0),
    Work("smooth", |c| c.texels() * c.iterations * c.taps, 0.0, 30.0),
    Work("smooth", |c| c.sides * (c.pixels - c.aggregate_pixels), 16.0, 0.0),
    // Plane, normal and index of the solid at each pixel.
    Work("gbuffer", |c| c.pixels, 32.0, 60.0),
    Work("gbuffer", |c| c.pixels * c.solids, 0.0, 28.0),
    // Every level is read and written once, level 0 only read.
    Work("mips", |c| c.sides * c.classes * c.pixels, 16.0 * 5.0 / 3.0, 20.0),
    // Both sides are read once, and evaluated at the centre.
    Work("bounds", |c| c.sides * c.classes * c.liquid_pixels, 16.0, 20.0),
    // Planes are read, and light is written and averaged; a pixel looks along one direction over 12 steps, and along two
    // more past the liquid.
    Work("turbid", |c| c.liquid_pixels, 16.0 * 5.0, 12.0 * 30.0),
    Work("turbid", |c| c.liquid_pixels * c.solids, 0.0, 3.0 * 28.0),
    // Every plane is read and every pixel written once. A ray is refracted and its reflection
    // computed at each interface; each evaluation of a layer covers front and back.
    Work("refract", |c| c.sides * c.classes * c.liquid_pixels, 16.0, 0.0),
    Work("refract", |c| c.pixels, 16.0, 0.0),
    Work("refract", |c| c.rays, 0.0, 60.0),
    Work("refract", |c| c.interfaces, 0.0, 90.0),
    Work("refract", |c| c.evaluations * c.classes, 0.0, 60.0),
    Work("refract", |c| c.background_rays, 0.0, 60.0),
    Work("refract", |c| c.solid_traces() * c.solids, 0.0, 28.0),
    // Lit surfaces look up each light's map and test occluders.
    Work("refract", |c| (c.rays + c.background_rays) * c.lights, 0.0, 150.0),
    Work("refract", |c| (c.rays + c.background_rays) * c.lights * c.solids, 0.0, 28.0),
    Work("tonemap", |c| c.pixels, 20.0, 40.0),
    // The light's fronts, read once; then the position of each vertex, and whether a solid occludes
    // it.
    Work("caustics", |c| (c.forward + c.gather) * c.classes * c.liquid_pixels, 16.0, 0.0),
    Work("caustics", |c| (c.forward + c.gather) * c.vertices, 32.0, 80.0),
    Work("caustics", |c| (c.forward + c.gather) * c.vertices * c.solids, 0.0, 28.0),
    // Forward: a path per vertex, two evaluations per interface; then the light of each subdivided
    // cell is splatted, and the sums are read and written.
    Work("caustics", |c| c.forward * c.vertices, 2.0 * (32.0 + 48.0), 60.0),
    Work("caustics", |c| c.forward * c.vertices * c.light_interfaces * c.classes, 0.0, 210.0),
    Work("caustics", |c| c.forward * c.parts, 0.0, 150.0),
    Work("caustics", |c| c.forward * c.pixels, 24.0 + 24.0, 10.0),
    // Gather: a walk over at least one triangle.
    Work("caustics", |c| c.gather * c.pixels, 16.0 + 16.0, 300.0),
    // The map: receivers and layers are read, irradiance and receiver written. A blur reads and
    // writes it twice, over three standard deviations of at least one texel.
    Work("caustics", |c| c.pixels, 16.0 + 32.0, 80.0),
    Work("caustics", |c| c.blurred * c.pixels, 2.0 * 48.0, 2.0 * 7.0 * 8.0),
];

/// Maps a light's pass to the equivalent pass of the eye; returns all other names unchanged.
fn equivalent_eye_pass(pass: &str) -> String {
    match pass {
        "light splashes" => "splat splashes".into(),
        _ => pass.strip_prefix("light ").unwrap_or(pass).into(),
    }
}

/// Bytes and operations of a pass; `None` if the model does not include the pass.
pub fn work(pass: &str, counts: &Counts) -> Option<(f64, f64)> {
    let pass = equivalent_eye_pass(pass);
    let of_pass = MODEL.iter().filter(|work| work.0 == pass);
    let sum = |(bytes, operations): (f64, f64), Work(_, per, by, op): &Work| {
        let times = per(counts);
        (bytes + times * by, operations + times * op)
    };
    MODEL.iter().any(|work| work.0 == pass).then(|| of_pass.fold((0.0, 0.0), sum))
}

/// Counts the eye's view before it is rendered: everything but interfaces and evaluations.
pub fn eye_counts(scene: &Scene, camera: &Camera, splats: &Splats, size: UVec2) -> Counts {
    let refract = &scene.settings.refract;
    let counts = view_counts(scene, &camera.uniform(size, splats.origin), splats);
    // Pixel corners are shared with the neighbours: with the centre, two rays per pixel.
    let edges = refract.edge_samples > refract.samples;
    let background = if edges { 2.0 } else { refract.samples.into() };
    Counts {
        sides: if refract.interfaces > 1 { 2.0 } else { 1.0 },
        lights: if scene.is_lit() { scene.lights.len() as f64 } else { 0.0 },
        rays: counts.liquid_pixels * f64::from(refract.samples),
        background_rays: (counts.pixels - counts.liquid_pixels) * background,
        ..counts
    }
}

/// Counts the view of each light that has one.
pub fn light_counts(scene: &Scene, splats: &Splats) -> Vec<Counts> {
    let settings = &scene.settings.caustics;
    let flag = |on: bool| f64::from(u8::from(on));
    let views = if scene.is_lit() { lights::light_views(scene, splats) } else { Vec::new() };
    let of_view = |(view, method, blurred): (&limpid::light_view::LightView, Method, bool)| {
        let cells = caustics::cells(view.size, settings.grid).as_dvec2();
        Counts {
            sides: settings.interfaces.into(),
            vertices: (cells + 1.0).element_product(),
            parts: cells.element_product() * f64::from(settings.subdivide).powi(2),
            light_interfaces: settings.interfaces.into(),
            forward: flag(method == Method::Forward),
            gather: flag(method == Method::Gather),
            blurred: flag(blurred),
            ..view_counts(scene, &view.uniform(splats.origin), splats)
        }
    };
    let of_light = |views: &lights::LightViews| {
        let map = views.map.iter().map(|view| (view, settings.method, settings.blur > 0.0));
        let straight = views.straight.iter().flatten().map(|view| (view, Method::Straight, false));
        map.chain(straight).map(of_view).collect::<Vec<_>>()
    };
    views.iter().flat_map(of_light).collect()
}

/// Counts the quantities that any view has.
fn view_counts(scene: &Scene, uniform: &CameraUniform, splats: &Splats) -> Counts {
    let size = uniform.size.as_uvec2();
    let mut covered = vec![false; size.element_product() as usize];
    let (aggregate_fragments, aggregate_pixels) = cover(uniform, &splats.aggregates, &mut covered);
    let mut by_splashes = vec![false; covered.len()];
    let (splash_fragments, splash_pixels) = cover(uniform, &splats.splashes, &mut by_splashes);
    covered.iter_mut().zip(by_splashes).for_each(|(covered, splash)| *covered |= splash);
    let tiles = size.map(|n| n.div_ceil(TILE));
    let mut in_tile = vec![false; tiles.element_product() as usize];
    for i in (0..).zip(&covered).filter_map(|(i, &covered)| covered.then_some(i)) {
        let (x, y) = (i % size.x / TILE, i / size.x / TILE);
        in_tile[(y * tiles.x + x) as usize] = true;
    }
    let count = |marks: &[bool]| marks.iter().filter(|&&mark| mark).count() as f64;
    let smooth = &scene.settings.smooth;
    Counts {
        pixels: f64::from(size.element_product()),
        tiles: in_tile.len() as f64,
        liquid_tiles: count(&in_tile),
        classes: if splats.splashes.is_empty() { 1.0 } else { 2.0 },
        aggregates: splats.aggregates.len() as f64,
        aggregate_fragments,
        aggregate_pixels,
        splashes: splats.splashes.len() as f64,
        splash_fragments,
        splash_pixels,
        liquid_pixels: count(&covered),
        iterations: smooth.iterations.into(),
        taps: f64::from(smooth.taps).powi(2),
        solids: scene.solids.len() as f64,
        ..Counts::default()
    }
}

/// Marks the pixels whose centres splats cover. Returns the number of fragments, one per splat and
/// pixel, and of newly marked pixels.
fn cover(uniform: &CameraUniform, splats: &[Splat], covered: &mut [bool]) -> (f64, f64) {
    let size = uniform.size.as_ivec2();
    let (mut fragments, mut pixels) = (0.0, 0.0);
    let mut mark = |y: i32, from: i32, to: i32| {
        let row = &mut covered[(y * size.x) as usize..][..size.x as usize];
        for pixel in &mut row[from as usize..to as usize] {
            pixels += f64::from(u8::from(!*pixel));
            *pixel = true;
        }
        fragments += f64::from(to - from);
    };
    // The first pixel whose centre is at or beyond `x`.
    let pixel = |x: f64, size: i32| ((x - 0.5).ceil()).clamp(0.0, size.into()) as i32;
    for splat in splats {
        let silhouette = match silhouette(uniform, splat) {
            Silhouette::Hidden => continue,
            Silhouette::Cut(cut) => {
                let (low, high) = cut.bounds(uniform);
                let (left, right) = (pixel(low.x, size.x), pixel(high.x, size.x));
                for y in pixel(low.y, size.y)..pixel(high.y, size.y) {
                    // A convex shape covers one run per row.
                    let hit = |x: &i32| cut.is_hit(uniform, IVec2::new(*x, y));
                    if let Some(from) = (left..right).find(hit) {
                        let to = (from..right).rfind(hit).map_or(from, |last| last + 1);
                        mark(y, from, to);
                    }
                }
                continue;
            }
            Silhouette::Ellipse(silhouette) => silhouette,
        };
        let Ellipse { centre, xx, xy, yy } = silhouette;
        let half = yy.sqrt();
        for y in pixel(centre.y - half, size.y)..pixel(centre.y + half, size.y) {
            let dy = f64::from(y) + 0.5 - centre.y;
            let middle = centre.x + xy / yy * dy;
            let half = ((xx - xy * xy / yy) * (1.0 - dy * dy / yy)).max(0.0).sqrt();
            let (from, to) = (pixel(middle - half, size.x), pixel(middle + half, size.x));
            if from < to {
                mark(y, from, to);
            }
        }
    }
    (fragments, pixels)
}

enum Silhouette {
    /// In front of the near plane.
    Hidden,
    /// Clipped by the near plane.
    Cut(Cut),
    Ellipse(Ellipse),
}

/// An ellipsoid { centre + A s : |s| <= 1 } in view space, clipped by the near plane.
struct Cut {
    centre: DVec3,
    axes: DMat3,
    to_sphere: DMat3,
    near: f64,
}

impl Cut {
    /// Whether the ray through a pixel's centre hits the remaining part.
    fn is_hit(&self, uniform: &CameraUniform, pixel: IVec2) -> bool {
        let ndc = 2.0 * (pixel.as_dvec2() + 0.5) / uniform.size.as_dvec2() - 1.0;
        let ray = (ndc * DVec2::new(1.0, -1.0) * uniform.tangent.as_dvec2()).extend(-1.0);
        let (ray, start) = (self.to_sphere * ray, self.to_sphere * -self.centre);
        let (a, b, c) = (ray.length_squared(), start.dot(ray), start.length_squared() - 1.0);
        let discriminant = b * b - a * c;
        discriminant >= 0.0 && discriminant.sqrt() - b >= a * self.near
    }

    /// The corners of the bounding rectangle of the remaining part, pixels.
    fn bounds(&self, uniform: &CameraUniform) -> (DVec2, DVec2) {
        let size = uniform.size.as_dvec2();
        let scale = 0.5 * size / uniform.tangent.as_dvec2();
        let [x, y] = [0, 1].map(|axis| self.slopes(axis));
        let (low, high) = (DVec2::new(x[0], -y[1]), DVec2::new(x[1], -y[0]));
        (0.5 * size + scale * low, 0.5 * size + scale * high)
    }

    /// The least and the greatest x / depth, or y / depth; as `cut_slopes` in `splat/ellipsoid.wgsl`.
    fn slopes(&self, axis: usize) -> [f64; 2] {
        let (a, g) = (self.axes.row(axis), self.axes.row(2));
        let (x, depth) = (self.centre[axis], -self.centre.z);
        let beyond = (depth - self.near) / g.length();
        let middle = x + beyond * a.dot(g) / g.length();
        let half = (1.0 - beyond * beyond).max(0.0).sqrt() * a.cross(g).length() / g.length();
        let mut slopes = vec![(middle - half) / self.near, (middle + half) / self.near];
        // Tangent lines { x = b depth }: q b² − 2 r b − s = 0.
        let (q, s) = (depth * depth - g.dot(g), a.dot(a) - x * x);
        let r = a.dot(g) + x * depth;
        let root = (r * r + q * s).sqrt().copysign(r);
        for (over, under) in [(r + root, q), (-s, r + root)] {
            let across = under * a + over * g;
            let at = depth + g.dot(across) * (under * x - over * depth) / across.length_squared();
            // NaN if there is no tangent.
            if at >= self.near {
                slopes.push(over / under);
            }
        }
        let least = slopes.iter().copied().fold(f64::INFINITY, f64::min);
        [least, slopes.iter().copied().fold(f64::NEG_INFINITY, f64::max)]
    }
}

/// { centre + d : d S⁻¹ d <= 1 }, S symmetric, pixels.
struct Ellipse {
    centre: DVec2,
    xx: f64,
    xy: f64,
    yy: f64,
}

/// The silhouette of a splat: the projection of its dual quadric (Hartley and Zisserman, Multiple
/// View Geometry, 2nd ed., eq. 8.5).
fn silhouette(uniform: &CameraUniform, splat: &Splat) -> Silhouette {
    let column = |[x, y, z, _]: [f32; 4]| DVec3::new(x.into(), y.into(), z.into());
    let [x, y, z] = uniform.view_from_world.map(column);
    let rotation = DMat3::from_cols(x, y, z);
    let centre = rotation * (uniform.origin + Vec3::from_array(splat.centre)).as_dvec3();
    let ([xx, yy, zz], [xy, xz, yz]) =
        (splat.diagonal.map(f64::from), splat.off_diagonal.map(f64::from));
    let shape = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
    let axes = rotation * shape;
    let spread = axes * axes.transpose();
    let (depth, reach, near) = (-centre.z, spread.z_axis.z.sqrt(), f64::from(uniform.near));
    if depth + reach <= near {
        return Silhouette::Hidden;
    }
    let (size, tangent) = (uniform.size.as_dvec2(), uniform.tangent.as_dvec2());
    let scale = 0.5 * size / tangent * DVec2::new(1.0, -1.0);
    let (middle, [xx, xy, yy]) = if uniform.far > 0.0 {
        let flat = [spread.x_axis.x, spread.x_axis.y, spread.y_axis.y];
        (centre.truncate(), flat)
    } else {
        if depth - reach <= near {
            return Silhouette::Cut(Cut { centre, axes, to_sphere: axes.inverse(), near });
        }
        // Points in front of the eye have z < 0: the slopes are x / -z and y / -z.
        let dual = |i: usize, j: usize| {
            let sign = if (i == 2) == (j == 2) { 1.0 } else { -1.0 };
            sign * (spread.col(j)[i] - centre[i] * centre[j])
        };
        let below = dual(2, 2);
        let middle = DVec2::new(dual(0, 2), dual(1, 2)) / below;
        let of = |i: usize, j: usize| middle[i] * middle[j] - dual(i, j) / below;
        (middle, [of(0, 0), of(0, 1), of(1, 1)])
    };
    Silhouette::Ellipse(Ellipse {
        centre: 0.5 * size + scale * middle,
        xx: scale.x * scale.x * xx,
        xy: scale.x * scale.y * xy,
        yy: scale.y * scale.y * yy,
    })
}

/// Renders a frame of a scene of `sims/` several times and compares the time of its passes with
/// their floors; sums follow the passes.
///
/// # Errors
/// As [`Renderer::render`]; [`limpid_io::Error::Usage`] for an unknown name.
pub fn measure(
    gpu: &Gpu,
    renderer: &mut Renderer,
    rates: Option<&Rates>,
    name: &str,
    width: u32,
    repeats: usize,
) -> Result<Vec<Budget>> {
    let (name, project, loaded) = subjects::load(name)?;
    let size = subjects::size(&name, width);
    let camera = project.camera_for(loaded.bulk.bounds);
    let frame = (&project.scene, &camera, &loaded.splats);
    measure_frame(gpu, renderer, rates, &name, frame, size, repeats)
}

/// As [`measure`], for any frame.
///
/// # Errors
/// As [`Renderer::render`].
pub fn measure_frame(
    gpu: &Gpu,
    renderer: &mut Renderer,
    rates: Option<&Rates>,
    name: &str,
    (scene, camera, splats): (&Scene, &Camera, &Splats),
    size: UVec2,
    repeats: usize,
) -> Result<Vec<Budget>> {
    let mut eye = eye_counts(scene, camera, splats, size);
    // Rendered once to count: interfaces and evaluations are only known after tracing.
    let target = Picture::new(gpu, size)?;
    let input = FrameInput::new(scene, camera, splats, size);
    renderer.render(FrameInput { diagnose: true, ..input }, &target)?;
    if let Some(diagnostics) = renderer.images().diagnostics {
        let texels = gpu.read_texture(&diagnostics, 0)?;
        let texels: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&texels);
        let sum = |i: usize| texels.iter().map(|texel| f64::from(texel[i])).sum::<f64>();
        let samples = f64::from(scene.settings.refract.samples);
        (eye.interfaces, eye.evaluations) = (samples * sum(0), samples * sum(2));
    }
    let lights = light_counts(scene, splats);
    let (_, times) = picture::draw(gpu, renderer, input, repeats)?;
    let Some(first) = times.first() else { return Ok(Vec::new()) };
    let row = |pass: &str, (bytes, operations): (f64, f64), ms: Option<f64>| Budget {
        scene: name.into(),
        size: size.to_array(),
        pass: pass.into(),
        bytes,
        operations,
        floor_ms: rates.map(|rates| rates.floor_ms(bytes, operations)),
        ms,
    };
    let mut rows: Vec<Budget> = Vec::new();
    let mut light = 0;
    for (i, pass) in first.iter().enumerate() {
        let of_light = pass.name.starts_with("light ") || pass.name == "caustics";
        let counts = if of_light { lights.get(light) } else { Some(&eye) };
        light += usize::from(pass.name == "caustics");
        // A pass without a model has no row; a test checks that there is none.
        let Some(work) = counts.and_then(|counts| work(pass.name, counts)) else { continue };
        let of_pass: Vec<f64> = times.iter().map(|passes| passes[i].ms).collect();
        rows.push(row(pass.name, work, median(&of_pass)));
    }
    // Merges the passes of all lights.
    let is_light = |row: &Budget| row.pass.starts_with("light ") || row.pass == "caustics";
    let mut merged: Vec<Budget> = Vec::new();
    for row in rows {
        match merged.iter_mut().find(|old| old.pass == row.pass) {
            Some(old) => old.add(&row),
            None => merged.push(row),
        }
    }
    let mut sums = Vec::new();
    let (of_lights, of_eye): (Vec<_>, Vec<_>) = merged.iter().partition(|row| is_light(row));
    let parts = [("all for the lights", of_lights), ("all for the camera", of_eye)];
    for (name, rows) in parts {
        if let Some((first, others)) = rows.split_first() {
            let mut sum = Budget { pass: name.into(), ..(*first).clone() };
            others.iter().for_each(|row| sum.add(row));
            sums.push(sum);
        }
    }
    merged.extend(sums);
    Ok(merged)
}

impl Budget {
    fn add(&mut self, other: &Self) {
        let sum = |a: Option<f64>, b: Option<f64>| a.zip(b).map(|(a, b)| a + b);
        self.bytes += other.bytes;
        self.operations += other.operations;
        self.floor_ms = sum(self.floor_ms, other.floor_ms);
        self.ms = sum(self.ms, other.ms);
    }
}

impl Rates {
    /// The minimum time for this work, ms.
    pub fn floor_ms(&self, bytes: f64, operations: f64) -> f64 {
        1e3 * (bytes / self.bytes_per_s).max(operations / self.operations_per_s)
    }
}
