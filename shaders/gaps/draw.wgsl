// Splats the two sides of a gap: the last back in front of the cell's split, and the first front behind
// it. A pixel whose liquid extends across the split has no gap.

#import splat.wgsl
#import gaps/cells.wgsl
#import gaps/swollen.wgsl

@group(2) @binding(0) var splits: texture_2d<f32>;
// Of each tile the least and the greatest depth of a split: of aggregates, then of splashes; 0 without any.
@group(2) @binding(1) var gap_tiles: texture_2d<f32>;

override GAP: u32 = 0u;     // which split
override CLASS: u32 = 0u;   // aggregates, splashes

// Splats that touch more tiles are drawn without a test.
const MOST_TILES: u32 = 64u;

@vertex
fn vertex_gap(@builtin(vertex_index) corner: u32, @builtin(instance_index) instance: u32) -> Varying {
    let splat = swollen(splats[instance]);
    var out = splat_varying(corner, splat);
    let placed = splat_in_view(splat);
    let low = splat_corner(0u, placed.centre, placed.rows);
    let high = splat_corner(3u, placed.centre, placed.rows);
    let half_depth = length(placed.rows[2]);
    if !meets_gap(low, high, -placed.centre.z - half_depth, -placed.centre.z + half_depth) {
        out.clip = vec4f(2.0, 2.0, 0.0, 1.0);
    }
    return out;
}

// Whether any tile of a rectangle, in normalised device coordinates, has a gap of which an ellipsoid between
// these depths may be the side.
fn meets_gap(low: vec2f, high: vec2f, nearest: f32, farthest: f32) -> bool {
    if any(low > vec2f(1.0)) || any(high < vec2f(-1.0)) {
        return false;
    }
    let end = camera.size - 1.0;
    let left_top = (vec2f(low.x, -high.y) * 0.5 + 0.5) * camera.size;
    let right_bottom = (vec2f(high.x, -low.y) * 0.5 + 0.5) * camera.size;
    let first = vec2u(clamp(left_top, vec2f(0.0), end)) / TILE;
    let last = vec2u(clamp(right_bottom, vec2f(0.0), end)) / TILE;
    let tiles = last - first + 1u;
    if tiles.x * tiles.y > MOST_TILES {
        return true;
    }
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let splits = textureLoad(gap_tiles, vec2u(x, y), 0);
            let of_class = select(splits.xy, splits.zw, CLASS == 1u);
            let sides = select(farthest >= of_class.x, nearest <= of_class.y, SIDE == BACK);
            if of_class.y > 0.0 && sides {
                return true;
            }
        }
    }
    return false;
}

@fragment
fn side(in: Varying) -> Fragment {
    let texel = vec2u(in.clip.xy);
    let split = textureLoad(splits, texel / CELL, 0)[GAP];
    let omega = camera_omega(in.clip.xy);
    let to_sphere = varying_to_sphere(in);
    let chord = splat_chord(in.centre, to_sphere, omega);
    if !chord.hit || split <= 0.0 {
        discard;
    }
    if abs(chord.middle - split) <= chord.half_length {
        // Liquid across the split: wins the depth test against all sides, and is empty.
        return Fragment(vec4f(0.0), depth_at(split));
    }
    // The ellipsoid itself, in the space of the swollen one.
    let discriminant = 1.0 / (CLOSING * CLOSING) - dot(chord.f, chord.f);
    let half_length = sqrt(max(discriminant, 0.0)) / length(chord.d);
    let before = chord.middle < split;
    if discriminant < 0.0 || before != (SIDE == BACK) {
        discard;
    }
    let towards = select(-half_length, half_length, SIDE == BACK);
    let z = chord.middle + towards;
    if z < camera.near {
        discard;
    }
    let normal = normalize(transpose(to_sphere) * (chord.f + towards * chord.d));
    return Fragment(vec4f(plane_from_normal(omega, z, normal), z), depth_at(z));
}
