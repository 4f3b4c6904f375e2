// The list of a tile, and the chords of a splat through the pixels of a thread.

#import splat/ellipsoid.wgsl
#import bins/params.wgsl
#import common/groups.wgsl
#import common/tiles.wgsl
#import $grain

@group(2) @binding(1) var<storage, read> placed: array<ViewSplat>;
@group(2) @binding(2) var<storage, read> starts: array<u32>;
@group(2) @binding(3) var<storage, read> cursors: array<vec2u>;
@group(2) @binding(4) var<storage, read> list: array<u32>;
@group(2) @binding(5) var<storage, read> busy: Numbers;

// Numbers of tiles.
struct Numbers {
    count: u32,
    tiles: array<u32>,
}

// Threads of a workgroup, and rows of a part.
const THREADS: u32 = TILE * TILE / ROWS;
const PART: u32 = ROWS / PARTS;

const NONE: u32 = 0xffffffffu;
// Beyond all depths.
const NOWHERE: f32 = 3e38;

fn tile_at(index: u32) -> vec2u {
    return vec2u(index % params.tiles.x, index / params.tiles.x);
}

// A tile's entries: those of splats that touch it end before those of splats that do where they are swollen.
struct Entries {
    begin: u32,
    inner_end: u32,
    end: u32,
}

fn entries_of(tile: u32) -> Entries {
    if params.rest != 0u {
        return Entries(0u, params.splats, params.splats);
    }
    let base = params.band * params.entries;
    let begin = starts[tile] - base;
    return Entries(begin, begin + cursors[tile].x, starts[tile + 1u] - base);
}

// A workgroup's tile, if it is in the band; otherwise none.
const NO_TILE: u32 = 0xffffffffu;

fn busy_tile(group: vec3u) -> u32 {
    let number = group_index(group);
    if number >= busy.count || !is_in_band(starts[busy.tiles[number]]) {
        return NO_TILE;
    }
    return busy.tiles[number];
}

// A splat's chords through the pixels of a part, at `camera_omega` x and y, as `splat_chord`.
struct Chords {
    middle: Real, // depth
    f2: Real,     // squared distance from the centre in sphere space
    inverse_d2: Real,
}

fn chords_of(s: ViewSplat, x: f32, y: Real) -> Chords {
    let depth = -s.z.w;
    var dx = Real(-s.z.x);
    var dy = Real(-s.z.y);
    var dz = Real(-s.z.z);
    var beside_x = x - s.x.w;
    var beside_y = y - s.y.w;
    if !ORTHOGRAPHIC {
        let across = s.x.xyz * x - s.z.xyz;
        dx = across.x + s.y.x * y;
        dy = across.y + s.y.y * y;
        dz = across.z + s.y.z * y;
        beside_x = depth * x - s.x.w;
        beside_y = depth * y - s.y.w;
    }
    let inverse_d2 = 1.0 / (dx * dx + dy * dy + dz * dz);
    let start_x = s.x.x * beside_x + s.y.x * beside_y;
    let start_y = s.x.y * beside_x + s.y.y * beside_y;
    let start_z = s.x.z * beside_x + s.y.z * beside_y;
    let along = (start_x * dx + start_y * dy + start_z * dz) * inverse_d2;
    let fx = start_x - along * dx;
    let fy = start_y - along * dy;
    let fz = start_z - along * dz;
    return Chords(depth - along, fx * fx + fy * fy + fz * fz, inverse_d2);
}

// Half the length in depth of a chord of an ellipsoid that is `scale2` times as large, squared; 0 beside it.
fn half_length(chords: Chords, scale2: f32) -> Real {
    return sqrt(max(scale2 - chords.f2, Real(0.0)) * chords.inverse_d2);
}
