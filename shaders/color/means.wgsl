// Colours of a body's surface: at each pixel, the mean of the particles around the first surface, weighted by a cubic spline
// (J. Monaghan, Smoothed Particle Hydrodynamics, 1992) of four particle radii and by volume. Of values, the mean is looked up
// in the colour map.
//
// Sums are integers, so that they do not depend on the order of the lists.

#import splat/lists.wgsl

const COLORS: u32 = 256u; // of the map

struct Coloring {
    per_radius: f32,  // inverse support of a particle of the usual radius, 1/m
    low: f32,         // value of the map's first color, as the particles' are stored
    per_range: f32,   // inverse of the range of the map
}

// Spheres of the kernels' supports. The fields that placing them does not read have the color: red, or the value, as
// the radius; green as the particle; blue as the tags.
@group(1) @binding(0) var<storage, read> splats: array<Splat>;
@group(3) @binding(0) var<uniform> coloring: Coloring;
@group(3) @binding(1) var<uniform> color_map: array<vec4f, COLORS>;
@group(3) @binding(2) var aggregate_layers: $layers;
@group(3) @binding(3) var splash_layers: $layers;
// Colour, and the value's place in the map's range, also beyond it.
@group(3) @binding(4) var colors: texture_storage_2d<rgba32float, write>;
// The sums of the chunks before, in tiles that are summed already.
@group(3) @binding(5) var state: texture_storage_2d_array<r32uint, read_write>;
@group(3) @binding(6) var<storage, read_write> summed: array<u32>;

override SPLASHES: bool = false; // the frame has splash layers
override VALUES: bool = false;   // particles have values instead of colors

// Parts of a usual particle's weight at its centre in which weights are counted.
const UNIT: f32 = 262144.0;

var<workgroup> batch: array<ViewSplat, THREADS>;
var<workgroup> batch_colors: array<vec3f, THREADS>;

// The first surface at a part's pixels, view space.
struct Places {
    x: Real,
    y: Real,
    z: Real,
    nearest: f32, // least and greatest depth
    farthest: f32,
}

struct Sums {
    red: Index,
    green: Index,
    blue: Index,
    weight: Index,
}

// Far from all particles.
const BEYOND: vec3f = vec3f(0.0, 0.0, 1e18);

fn place_at(texel: vec2u) -> vec3f {
    if any(texel >= vec2u(camera.size)) {
        return BEYOND;
    }
    let omega = camera_omega(vec2f(texel) + 0.5);
    var front = textureLoad(aggregate_layers, texel, FRONT$level).xyz;
    if SPLASHES {
        let splash = textureLoad(splash_layers, texel, FRONT$level).xyz;
        front = select(front, splash, dot(splash, omega) > dot(front, omega));
    }
    if plane_is_empty(front) {
        return BEYOND;
    }
    return camera_point(omega, dot(front, omega));
}

fn places_of(p: vec2u) -> Places {
    var at: array<vec3f, 4>;
    var ends = vec2f(3e38, -3e38);
    for (var i = 0u; i < PART; i++) {
        at[i] = place_at(p + vec2u(0u, i));
        let depth = -at[i].z;
        ends = select(ends, vec2f(min(ends.x, depth), max(ends.y, depth)), at[i].z < BEYOND.z);
    }
    let x = each_real(at[0].x, at[1].x, at[2].x, at[3].x);
    let y = each_real(at[0].y, at[1].y, at[2].y, at[3].y);
    let z = each_real(at[0].z, at[1].z, at[2].z, at[3].z);
    return Places(x, y, z, ends.x, ends.y);
}

fn saturated(a: Index, b: Real) -> Index {
    let sum = a + Index(b + Real(0.5));
    return select(sum, Index(0xffffffffu), sum < a);
}

fn add(sums: ptr<function, Sums>, s: ViewSplat, color: vec3f, at: Places) {
    let per_support2 = dot(s.x.xyz, s.x.xyz);
    let per_support = sqrt(per_support2);
    let depth = -s.z.w;
    if depth * per_support + 1.0 < at.nearest * per_support || depth * per_support - 1.0 > at.farthest * per_support {
        return;
    }
    let dx = at.x - s.x.w;
    let dy = at.y - s.y.w;
    let dz = at.z - s.z.w;
    let q = min(2.0 * sqrt((dx * dx + dy * dy + dz * dz) * per_support2), Real(2.0));
    let rest = 2.0 - q;
    let inner = max(1.0 - q, Real(0.0));
    let size = coloring.per_radius / per_support;
    // 1 - 3/2 q² + 3/4 q³, and (2 - q)³ / 4 from q = 1 on.
    let weight = UNIT * size * size * size * (0.25 * rest * rest * rest - inner * inner * inner);
    (*sums).red = saturated((*sums).red, weight * color.x);
    if !VALUES {
        (*sums).green = saturated((*sums).green, weight * color.y);
        (*sums).blue = saturated((*sums).blue, weight * color.z);
    }
    (*sums).weight = saturated((*sums).weight, weight);
}

fn color_of(index: u32) -> vec3f {
    let splat = splats[index];
    return vec3f(splat.radius, bitcast<f32>(splat.particle), bitcast<f32>(splat.tags));
}

fn mapped(value: f32) -> vec4f {
    let share = (value - coloring.low) * coloring.per_range;
    let place = clamp(share, 0.0, 1.0) * f32(COLORS - 1u);
    let first = min(u32(place), COLORS - 2u);
    let color = mix(color_map[first], color_map[first + 1u], place - f32(first));
    return vec4f(color.rgb, share);
}

fn store(p: vec2u, sums: Sums, add_to_state: bool) {
    for (var i = 0u; i < PART; i++) {
        let texel = p + vec2u(0u, i);
        if any(texel >= vec2u(camera.size)) {
            continue;
        }
        var sum = vec4u(index_at(sums.red, i), index_at(sums.green, i), index_at(sums.blue, i), index_at(sums.weight, i));
        for (var k = 0u; k < 4u; k++) {
            let before = select(0u, textureLoad(state, texel, k).x, add_to_state);
            sum[k] = select(before + sum[k], 0xffffffffu, before + sum[k] < before);
            textureStore(state, texel, k, vec4u(sum[k]));
        }
        let mean = vec3f(sum.xyz) / max(f32(sum.w), 1.0);
        if VALUES {
            textureStore(colors, texel, mapped(mean.x));
        } else {
            textureStore(colors, texel, vec4f(mean, 1.0));
        }
    }
}

fn draw(tile: u32, local: vec2u, thread: u32) {
    let p = tile_at(tile) * TILE + local * vec2u(1u, ROWS);
    let entries = entries_of(tile);
    let upper_places = places_of(p);
    var lower_places = upper_places;
    if PARTS > 1u {
        lower_places = places_of(p + vec2u(0u, PART));
    }
    var upper = Sums(Index(0u), Index(0u), Index(0u), Index(0u));
    var lower = upper;
    if STAGED {
        for (var base = entries.begin; base < entries.inner_end; base += THREADS) {
            workgroupBarrier();
            if base + thread < entries.inner_end {
                let index = list[base + thread];
                batch[thread] = placed[index];
                batch_colors[thread] = color_of(index);
            }
            workgroupBarrier();
            for (var k = 0u; k < min(THREADS, entries.inner_end - base); k++) {
                add(&upper, batch[k], batch_colors[k], upper_places);
            }
        }
    } else {
        for (var i = entries.begin; i < entries.inner_end; i++) {
            let index = list[i];
            let s = placed[index];
            let color = color_of(index);
            add(&upper, s, color, upper_places);
            if PARTS > 1u {
                add(&lower, s, color, lower_places);
            }
        }
    }
    let add_to_state = summed[tile] != 0u;
    workgroupBarrier();
    if thread == 0u {
        summed[tile] = 1u;
    }
    store(p, upper, add_to_state);
    if PARTS > 1u {
        store(p + vec2u(0u, PART), lower, add_to_state);
    }
}

@compute @workgroup_size(TILE, TILE / ROWS)
fn colors_of_tiles(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let tile = busy_tile(group);
    if tile != NO_TILE {
        draw(tile, local.xy, thread);
    }
}
