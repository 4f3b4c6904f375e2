//! The solids of `scene.wgsl`: intersection, distance and checkers.

use glam::{DVec2, DVec3};
use limpid::gpu::Gpu;
use limpid::passes::mesh_buffers::MeshBuffers;
use limpid::wgpu;

use crate::support::view::{NOTHING, assert_near, case, number, round3, vec3};
use crate::support::{Kernel, Random, gpu};

/// A solid's shape in 64 bits, numbered as in `common/scene.wgsl`.
#[derive(Debug, Clone, Copy)]
enum Form {
    Plane { normal: DVec3, half_extent: f64 },
    Box { half: DVec3 },
    Sphere { radius: f64 },
}

impl Form {
    /// Shape, extent and half extent.
    fn numbers(self) -> [f64; 5] {
        match self {
            Self::Plane { normal: n, half_extent } => [0.0, n.x, n.y, n.z, half_extent],
            Self::Box { half } => [1.0, half.x, half.y, half.z, 0.0],
            Self::Sphere { radius } => [2.0, radius, radius, radius, 0.0],
        }
    }

    fn grown(self, by: f64) -> Self {
        match self {
            Self::Plane { normal, half_extent } => {
                Self::Plane { normal, half_extent: half_extent + by }
            }
            Self::Box { half } => Self::Box { half: half + by },
            Self::Sphere { radius } => Self::Sphere { radius: radius + by },
        }
    }

    /// Nearest hit along o + t d, t > 0, relative to the solid's origin, and the normal there.
    fn trace(self, o: DVec3, d: DVec3) -> Option<(f64, DVec3)> {
        let mut hits = Vec::new();
        match self {
            Self::Plane { normal, half_extent } => {
                let t = -o.dot(normal) / d.dot(normal);
                let within = in_plane(normal, o + t * d).abs().max_element() <= half_extent;
                hits.extend(within.then_some((t, normal)));
            }
            Self::Box { half } => {
                // Each of the six faces as a rectangle.
                for axis in 0..3 {
                    for side in [-1.0, 1.0] {
                        let t = (side * half[axis] - o[axis]) / d[axis];
                        let mut x = o + t * d;
                        x[axis] = 0.0;
                        let mut normal = DVec3::ZERO;
                        normal[axis] = side;
                        hits.extend(x.abs().cmple(half).all().then_some((t, normal)));
                    }
                }
            }
            Self::Sphere { radius } => {
                let (a, b, c) = (d.dot(d), o.dot(d), o.dot(o) - radius * radius);
                let root = (b * b - a * c).sqrt();
                for t in [(-b - root) / a, (-b + root) / a] {
                    hits.push((t, (o + t * d) / radius));
                }
            }
        }
        hits.retain(|(t, _)| *t > 0.0 && t.is_finite());
        hits.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn distance(self, x: DVec3) -> f64 {
        match self {
            Self::Plane { normal, half_extent } => {
                let beside = in_plane(normal, x).abs().max_element() > half_extent;
                if beside { NOTHING } else { x.dot(normal).abs() }
            }
            Self::Box { half } => {
                let beyond = x.abs() - half;
                if beyond.max_element() <= 0.0 {
                    beyond.max_element()
                } else {
                    x.distance(x.clamp(-half, half))
                }
            }
            Self::Sphere { radius } => x.length() - radius,
        }
    }
}

/// Coordinates in a plane: drops the axis closest to the normal.
fn in_plane(normal: DVec3, x: DVec3) -> DVec2 {
    let a = normal.abs();
    if a.y >= a.x && a.y >= a.z {
        DVec2::new(x.x, x.z)
    } else if a.x >= a.z {
        DVec2::new(x.z, x.y)
    } else {
        DVec2::new(x.x, x.y)
    }
}

/// A random solid of about unit size; `kind` cycles through the shapes.
fn random_form(random: &mut Random, kind: usize) -> Form {
    match kind % 4 {
        0 => Form::Plane { normal: random.direction(), half_extent: random.magnitude(0.1, 10.0) },
        1 => Form::Plane { normal: DVec3::Y, half_extent: 1e30 },
        2 => Form::Box { half: DVec3::from_array([(); 3].map(|()| random.magnitude(0.1, 10.0))) },
        _ => Form::Sphere { radius: random.magnitude(0.1, 10.0) },
    }
}

/// Meshes and textures, which these solids do not have.
fn no_meshes(meshes: &MeshBuffers) -> [(u32, u32, wgpu::BindingResource<'_>); 2] {
    let geometry = wgpu::BindingResource::TextureView(&meshes.geometry);
    [(2, 7, geometry), (2, 8, meshes.surfaces.as_entire_binding())]
}

const SOLID_KERNEL: &str = "
    fn the_solid(x: array<f32, 14>, phase: vec3f) -> Solid {
        return Solid(vec3f(x[0], x[1], x[2]), u32(x[3]), vec3f(x[4], x[5], x[6]), x[7],
            vec3f(1.0), x[11], vec3f(0.0), 0u, phase, 0.0, vec3f(0.0), 0u, vec4f(0.0), vec3u(0u), 0u);
    }";

/// Computes distance along the ray, distance of its origin from the surface, and normal at the hit on the
/// device. Cases hold the solid's origin and numbers, then the ray.
fn trace_solids(gpu: &Gpu, cases: &[[f32; 14]]) -> Vec<[f32; 5]> {
    let body = format!(
        "{SOLID_KERNEL}
        fn test(x: array<f32, 14>) -> array<f32, 5> {{
            let solid = the_solid(x, vec3f(0.0));
            let o = vec3f(x[8], x[9], x[10]);
            let d = vec3f(x[11], x[12], x[13]);
            let t = solid_trace(solid, o, d);
            let n = solid_normal(solid, o + t * d);
            return array(t, solid_distance(solid, o), n.x, n.y, n.z);
        }}"
    );
    let kernel =
        Kernel { imports: &["common/scene.wgsl"], body: &body, constants: &[], resources: &[] };
    kernel.run(gpu, cases)
}

/// Shape and ray of a case at device precision, relative to the solid's origin.
fn solid_and_ray(x: &[f32; 14]) -> (Form, DVec3, DVec3) {
    let extent = vec3(&x[4..7]);
    let form = match x[3] {
        0.0 => Form::Plane { normal: extent, half_extent: x[7].into() },
        1.0 => Form::Box { half: extent },
        _ => Form::Sphere { radius: extent.x },
    };
    (form, vec3(&x[8..11]) - vec3(&x[..3]), vec3(&x[11..14]))
}

/// Checks that the device's hits lie between those for solids enlarged and shrunk by the rounding error
/// at their distance, and that it misses only if one of these is missed. Returns the number of sharp
/// cases, in which both are hit or both are missed.
fn check_traces(gpu: &Gpu, cases: &[[f32; 14]]) -> usize {
    let results = trace_solids(gpu, cases);
    let checked = || cases.iter().zip(&results).map(|(x, result)| check_trace(x, *result));
    let wrong: Vec<_> = checked().filter_map(Result::err).collect();
    assert!(wrong.is_empty(), "{} of {} wrong, as {}", wrong.len(), cases.len(), wrong[0]);
    checked().filter(|sharp| *sharp == Ok(true)).count()
}

fn check_trace(x: &[f32; 14], result: [f32; 5]) -> Result<bool, String> {
    let (form, o, d) = solid_and_ray(x);
    // Origin and direction are accurate to 6e-8, which limits the accuracy of the ray.
    let rounding = 4e-7 * o.length() + 1e-6;
    let hits = [rounding, -rounding].map(|by| form.grown(by).trace(o, d));
    let t = f64::from(result[0]);
    let found = t > 0.0 && t < NOTHING;
    let (a, b) = match hits {
        [Some(a), Some(b)] => (a, b),
        [None, None] if found => {
            return Err(format!("{form:?} from {o} along {d} must be missed, and is hit at {t}"));
        }
        hits => return Ok(hits == [None, None]),
    };
    let slack = 1e-6 * (a.0 + o.length());
    let (slack, radius) = match form {
        // A plane at a slant: the rounding error of its distance is divided by the cosine.
        Form::Plane { .. } => (slack / a.1.dot(d).abs(), NOTHING),
        Form::Box { .. } => (slack, NOTHING),
        Form::Sphere { radius } => (slack, radius),
    };
    let (low, high) = (a.0.min(b.0) - slack, a.0.max(b.0) + slack);
    if !found || !(low..=high).contains(&t) {
        return Err(format!("{form:?} from {o} along {d} must be hit at {low} to {high}, not {t}"));
    }
    // At an edge, rounding decides the face.
    let off = vec3(&result[2..]).distance(a.1);
    if a.1.distance(b.1) < 1e-2 && off > 1e-2 + 2.0 * rounding / radius {
        return Err(format!(
            "{form:?} from {o} along {d} has normal {}, not {}",
            vec3(&result[2..]),
            a.1
        ));
    }
    Ok(true)
}

/// Rays hit planes, boxes and spheres from any origin, including inside.
#[test]
fn solids_are_traced() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(11);
    let cases: Vec<[f32; 14]> = (0..40_000)
        .map(|i| {
            let form = random_form(&mut random, i);
            let origin = random.direction() * random.unit() * 10.0;
            let o = origin + random.direction() * random.magnitude(1e-2, 30.0);
            // Two thirds aim at the solid, or nearly.
            let aim = origin + random.direction() * random.magnitude(1e-3, 10.0) - o;
            let d = if i % 3 == 0 { random.direction() } else { aim.normalize() };
            case(&[&origin.to_array(), &form.numbers(), &o.to_array(), &d.to_array()])
        })
        .collect();
    let sharp = check_traces(gpu, &cases);
    assert!(sharp > 39_000, "only {sharp} sharp cases");
}

/// Axis-parallel rays, which are common with axis-aligned cameras and level water, are traced correctly,
/// also with origins in the planes of faces.
#[test]
fn solids_are_traced_along_axes() {
    let Some(gpu) = gpu() else { return };
    let mut cases = Vec::new();
    let forms = [
        Form::Box { half: DVec3::new(1.0, 2.0, 3.0) },
        Form::Sphere { radius: 1.5 },
        Form::Plane { normal: DVec3::Y, half_extent: 1e30 },
        Form::Plane { normal: DVec3::X, half_extent: 2.0 },
    ];
    let places = [-5.0, -0.5, 0.0, 0.25, 5.0];
    for form in forms {
        for o in 0..places.len().pow(3) {
            let o = DVec3::new(places[o % 5], places[o / 5 % 5], places[o / 25]);
            for d in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.6, 0.0, 0.8)] {
                for d in [d, -d] {
                    let numbers = form.numbers();
                    cases.push(case(&[&[0.0; 3], &numbers, &o.to_array(), &d.to_array()]));
                }
            }
        }
    }
    check_traces(gpu, &cases);
}

/// Spheres at a distance of 10⁴ radii are hit and missed correctly, where the textbook discriminant has
/// no precision left.
#[test]
fn solids_are_traced_far_away() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(12);
    let cases: Vec<[f32; 14]> = (0..10_000)
        .map(|_| {
            let radius = random.magnitude(1e-2, 1e2);
            let o = random.direction() * random.unit();
            let origin = o + random.direction() * 1e4 * radius;
            let aim = origin + random.direction() * 2.0 * radius * random.unit() - o;
            let form = Form::Sphere { radius };
            let d = aim.normalize();
            case(&[&origin.to_array(), &form.numbers(), &o.to_array(), &d.to_array()])
        })
        .collect();
    let sharp = check_traces(gpu, &cases);
    assert!(sharp > 9500, "only {sharp} sharp cases");
}

/// The distance of a point from a solid is exact, negative inside, and `NOTHING` beside a plane's square.
#[test]
fn solids_have_distances() {
    let Some(gpu) = gpu() else { return };
    let mut random = Random(13);
    let cases: Vec<[f32; 14]> = (0..20_000)
        .map(|i| {
            let form = random_form(&mut random, i);
            let x = random.direction() * random.magnitude(1e-3, 30.0);
            case(&[&[0.0; 3], &form.numbers(), &x.to_array(), &[0.0, 0.0, 1.0]])
        })
        .collect();
    for (x, result) in cases.iter().zip(trace_solids(gpu, &cases)) {
        let (form, o, _) = solid_and_ray(x);
        let expected = form.distance(o);
        // A point above a square's border may count as either side.
        if expected.max(form.grown(1e-5).distance(o)) < NOTHING || result[1] < 1e30 {
            if form.grown(-1e-5).distance(o) >= NOTHING && expected < NOTHING {
                continue;
            }
            assert_near(number(result, 1), expected, 1e-6 * (1.0 + o.length()), "distance");
        } else {
            assert_eq!(expected, NOTHING, "{x:?}");
        }
    }
}

/// Checkers alternate through the world origin without a double or missing tile, on floors, walls and
/// balls, for any eye position; the tile at the origin is even.
#[test]
fn checkers_alternate_through_zero() {
    let Some(gpu) = gpu() else { return };
    let body = format!(
        "{SOLID_KERNEL}
        fn test(x: array<f32, 14>) -> array<f32, 1> {{
            let solid = the_solid(x, vec3f(x[0], x[1], x[2]));
            let color = solid_color(solid, NO_TRIANGLE, vec3f(x[8], x[9], x[10]), vec3f(x[4], x[5], x[6]), vec3f(0.0), 0.0);
            return array(color.x);
        }}"
    );
    let meshes = MeshBuffers::new(gpu);
    let kernel = Kernel {
        imports: &["common/scene.wgsl"],
        body: &body,
        constants: &[],
        resources: &no_meshes(&meshes),
    };
    let mut random = Random(14);
    let mut cases: Vec<[f32; 14]> = Vec::new();
    let mut even = Vec::new();
    let tile = 0.5;
    while cases.len() < 10_000 {
        let (form, normal) = match cases.len() % 4 {
            0 => (0.0, DVec3::Y),
            1 => (0.0, DVec3::X),
            2 => (1.0, DVec3::NEG_Z),
            _ => (2.0, DVec3::ONE),
        };
        let x = random.direction() * random.magnitude(0.05, 50.0);
        let eye = random.direction() * random.magnitude(0.05, 1e5);
        let phase = (eye / tile).rem_euclid(DVec3::splat(2.0));
        let x = round3(x);
        let tiles = (eye + x) / tile;
        if (tiles - tiles.round()).abs().min_element() < 1e-4 {
            continue; // on a seam
        }
        let [i, j, k] = tiles.floor().to_array().map(|n| n as i64);
        let sum = match form {
            2.0 => i + j + k,
            _ if normal == DVec3::Y => i + k,
            _ if normal == DVec3::X => j + k,
            _ => i + j,
        };
        even.push(sum.rem_euclid(2) == 0);
        let half = &[1.0];
        cases.push(case(&[
            &phase.to_array(),
            &[form],
            &normal.to_array(),
            half,
            &x.to_array(),
            &[tile, 0.0, 0.0],
        ]));
    }
    let results: Vec<[f32; 1]> = kernel.run(gpu, &cases);
    for ((x, result), even) in cases.iter().zip(results).zip(even) {
        assert_eq!(result[0] == 1.0, even, "{x:?}");
    }
}

/// Filtered checkers have the share of even tiles in a ray's footprint: the mean over the parallelogram that
/// contains the ellipse in which a ray of that width meets the plane, within the error of the sum; a narrow
/// ray gives the tile itself, and one much wider than a tile gives one half.
#[test]
fn checkers_are_filtered_over_the_footprint() {
    let Some(gpu) = gpu() else { return };
    let body = format!(
        "{SOLID_KERNEL}
        fn test(x: array<f32, 14>) -> array<f32, 1> {{
            let solid = the_solid(x, vec3f(0.0));
            let d = normalize(vec3f(x[12], -1.0, x[13]));
            return array(solid_color(solid, NO_TRIANGLE, vec3f(x[8], 0.0, x[10]), vec3f(0.0, 1.0, 0.0), d, x[9]).x);
        }}"
    );
    let meshes = MeshBuffers::new(gpu);
    let kernel = Kernel {
        imports: &["common/scene.wgsl"],
        body: &body,
        constants: &[("FILTER_PATTERNS", 1.0)],
        resources: &no_meshes(&meshes),
    };
    let mut random = Random(18);
    let tile = 0.5;
    let mut cases: Vec<[f32; 14]> = Vec::new();
    let mut shares = Vec::new();
    while cases.len() < 3000 {
        let (x, z) = (random.range(-20.0, 20.0), random.range(-20.0, 20.0));
        let (tilt_x, tilt_z) = (random.range(-4.0, 4.0), random.range(-4.0, 4.0));
        let width = random.magnitude(1e-3, 3.0);
        // d = (tilt_x, −1, tilt_z)/length: the extents along x and z are those of |a − n (a·d)/(n·d)|.
        // No footprint is smaller than a hundredth of a tile.
        let extents = [tilt_x, tilt_z].map(|tilt: f64| (width * tilt.hypot(1.0) / tile).max(0.01));
        let mean = [x, z].into_iter().zip(extents).map(|(at, extent)| {
            let steps = 4000;
            let sample = |k: i32| {
                let offset = (f64::from(k) + 0.5) / f64::from(steps) - 0.5;
                if (at / tile + offset * extent).floor().rem_euclid(2.0) < 1.0 { 1.0 } else { -1.0 }
            };
            (0..steps).map(sample).sum::<f64>() / f64::from(steps)
        });
        shares.push(0.5 + 0.5 * mean.product::<f64>());
        let ray = [x, width, z, tile, tilt_x, tilt_z];
        cases.push(case(&[&[0.0, 0.0, 0.0, 0.0], &[0.0, 1.0, 0.0, 1e30], &ray]));
    }
    let results: Vec<[f32; 1]> = kernel.run(gpu, &cases);
    let (mut hard, mut soft) = (0, 0);
    for ((x, result), share) in cases.iter().zip(results).zip(shares) {
        let width = f64::from(x[9]);
        assert_near(result[0].into(), share, 0.012, &format!("{x:?}"));
        hard += usize::from(width < 5e-3 && (result[0] - 0.5).abs() > 0.499);
        soft += usize::from(width > 2.0 && (f64::from(result[0]) - 0.5).abs() < 0.05);
    }
    assert!(hard > 300 && soft > 100, "{hard} {soft}");
}
