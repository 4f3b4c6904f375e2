//! A coarse picture without a device: particles as discs, the far ones darker, until the first picture is drawn.

use eframe::egui::{Color32, Mesh, Painter, Pos2, Rect, Shape, vec2};
use glam::DVec3;

use crate::model::sketch::{enlarged, spread};
use crate::picture::camera_controls::{axes, half_height};
use limpid::camera::{Camera, Lens};
use limpid_io::input::Loaded;

/// Most discs: few, because the interface's thread draws them.
const MOST: usize = 6000;

/// Corners of a disc.
const CORNERS: u32 = 6;

/// Colours of the nearest and of the farthest particle.
const COLORS: [[f64; 3]; 2] = [[176.0, 206.0, 228.0], [38.0, 66.0, 96.0]];

/// A particle on the screen.
struct Disc {
    at: Pos2,
    radius: f32,
    depth: f64,
}

/// Draws some of the particles in `rect`; returns whether there are any on this side of a page's worker.
pub(crate) fn paint(painter: &Painter, rect: Rect, loaded: &Loaded, camera: &Camera) -> bool {
    let splats = &loaded.splats;
    let count = splats.aggregates.len() + splats.splashes.len();
    let larger = f64::from(enlarged(count, MOST));
    let bodies = splats.aggregates.len();
    let splat = |i: usize| splats.aggregates.get(i).or_else(|| splats.splashes.get(i - bodies));
    let mut discs: Vec<Disc> = spread(count, MOST)
        .filter_map(splat)
        .filter_map(|splat| {
            let place = splats.origin + DVec3::from(splat.centre.map(f64::from));
            disc(rect, camera, place, larger * f64::from(splat.radius))
        })
        .collect();
    discs.sort_by(|a, b| b.depth.total_cmp(&a.depth));
    let (Some(far), Some(near)) = (discs.first(), discs.last()) else { return count > 0 };
    let (far, near) = (far.depth, near.depth);
    let mut mesh = Mesh::default();
    for disc in &discs {
        let share = (disc.depth - near) / (far - near).max(f64::MIN_POSITIVE);
        let [r, g, b] = [0, 1, 2].map(|c| {
            let [light, dark] = COLORS.map(|color| color[c]);
            (light + share * (dark - light)) as u8
        });
        add(&mut mesh, disc, Color32::from_rgb(r, g, b));
    }
    painter.with_clip_rect(rect).add(Shape::mesh(mesh));
    true
}

/// A particle on the screen; `None` if it is behind the eye or beside the picture.
fn disc(rect: Rect, camera: &Camera, place: DVec3, radius: f64) -> Option<Disc> {
    let [right, up, back] = axes(camera);
    let offset = place - camera.eye;
    let depth = -offset.dot(back);
    let distance = camera.eye.distance(camera.target);
    let (half, ahead) = match camera.lens {
        Some(Lens::Orthographic { .. }) => (half_height(camera), true),
        _ => (half_height(camera) * depth / distance, depth > 0.0),
    };
    let scale = 0.5 * f64::from(rect.height()) / half;
    let shift = vec2((scale * offset.dot(right)) as f32, (-scale * offset.dot(up)) as f32);
    let radius = ((scale * radius) as f32).clamp(0.7, 0.25 * rect.height());
    let at = rect.center() + shift;
    (ahead && rect.expand(radius).contains(at)).then_some(Disc { at, radius, depth })
}

fn add(mesh: &mut Mesh, disc: &Disc, color: Color32) {
    let first = mesh.vertices.len() as u32;
    for corner in 0..CORNERS {
        let (sin, cos) = (std::f32::consts::TAU * corner as f32 / CORNERS as f32).sin_cos();
        mesh.colored_vertex(disc.at + disc.radius * vec2(cos, sin), color);
    }
    for corner in 1..CORNERS - 1 {
        mesh.add_triangle(first, first + corner, first + corner + 1);
    }
}
