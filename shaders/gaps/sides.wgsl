// The two sides of a gap: the last back in front of the cell's split, and the first front behind it. A pixel whose
// liquid extends across the split has no gap.

#import splat/lists.wgsl
#import common/sizes.wgsl
#import gaps/cells.wgsl

@group(1) @binding(0) var<storage, read> splats: array<Splat>;
@group(3) @binding(0) var splits: texture_2d<f32>;
@group(3) @binding(1) var<storage, read> gap_tiles: TileList;
@group(3) @binding(2) var layers: texture_storage_2d_array<rgba32float, write>;
// Depths of backs and fronts: of each gap two layers.
@group(3) @binding(3) var state: texture_storage_2d_array<r32uint, read_write>;

override GAPS: u32 = 1u;
override SIZES: bool = false; // radii differ, so that planes bear sizes: common/sizes.wgsl
override FIRST: bool = true;  // no chunk is before
override LAST: bool = true;   // no chunk follows

var<workgroup> batch: array<ViewSplat, THREADS>;
var<workgroup> batch_indices: array<u32, THREADS>;

// Depths and indices of both sides at a part's pixels.
struct Sides {
    back_z: Real,
    front_z: Real,
    back: Index,
    front: Index,
    crossed: Truth,
}

fn consider(sides: ptr<function, Sides>, s: ViewSplat, index: u32, x: f32, y: Real, split: f32) {
    let chords = chords_of(s, x, y);
    let near = Real(camera.near);
    let swollen = half_length(chords, CLOSING * CLOSING);
    let touched = (chords.f2 <= Real(CLOSING * CLOSING)) & (chords.middle + swollen >= near);
    let across = touched & (abs(chords.middle - split) <= swollen);
    let half = half_length(chords, 1.0);
    let before = chords.middle < Real(split);
    let z = select(chords.middle - half, chords.middle + half, before);
    let hit = touched & !across & (chords.f2 <= Real(1.0)) & (z >= near);
    let i = Index(index);
    let now = (*sides);
    let farther = hit & before & ((z > now.back_z) | ((z == now.back_z) & (i < now.back)));
    let nearer = hit & !before & ((z < now.front_z) | ((z == now.front_z) & (i < now.front)));
    (*sides).back_z = select(now.back_z, z, farther);
    (*sides).back = select(now.back, i, farther);
    (*sides).front_z = select(now.front_z, z, nearer);
    (*sides).front = select(now.front, i, nearer);
    (*sides).crossed = now.crossed | across;
}

// Where no chunk is before, nothing; otherwise the depths of those. A crossed pixel has a back beyond all depths.
fn initial(p: vec2u, gap: u32) -> Sides {
    if FIRST {
        return Sides(Real(0.0), Real(NOWHERE), Index(NONE), Index(NONE), Truth(false));
    }
    var back: array<f32, 4>;
    var front: array<f32, 4>;
    for (var i = 0u; i < PART; i++) {
        let texel = min(p + vec2u(0u, i), vec2u(camera.size) - 1u);
        back[i] = bitcast<f32>(textureLoad(state, texel, 2u * gap).x);
        front[i] = bitcast<f32>(textureLoad(state, texel, 2u * gap + 1u).x);
    }
    let back_z = each_real(back[0], back[1], back[2], back[3]);
    let front_z = each_real(front[0], front[1], front[2], front[3]);
    return Sides(back_z, front_z, Index(0u), Index(0u), back_z >= Real(NOWHERE));
}

fn is_found(index: u32, z: f32, initial_z: f32) -> bool {
    return select(z != initial_z, index != NONE, FIRST);
}

fn sized(plane: vec4f, index: u32) -> vec4f {
    if SIZES {
        return vec4f(with_particle_size(plane.xyz, particle_size_of(splats[index].radius)), plane.w);
    }
    return plane;
}

fn store(p: vec2u, gap: u32, split: f32, begun: Sides, sides: Sides) {
    for (var i = 0u; i < PART; i++) {
        let texel = p + vec2u(0u, i);
        if any(texel >= vec2u(camera.size)) {
            continue;
        }
        let omega = camera_omega(vec2f(texel) + 0.5);
        let kept = split > 0.0 && !truth_at(sides.crossed, i);
        let back_z = real_at(sides.back_z, i);
        let back = index_at(sides.back, i);
        let has_back = kept && is_found(back, back_z, real_at(begun.back_z, i));
        // Software adapters execute both sides of a branch: one store for both.
        if FIRST || !kept || has_back {
            let index = select(0u, back, has_back);
            let plane = sized(splat_back(placed[index], omega), index);
            textureStore(layers, texel, gap_back(i32(gap)), select(vec4f(0.0), plane, has_back));
        }
        let front_z = real_at(sides.front_z, i);
        let front = index_at(sides.front, i);
        let has_front = kept && is_found(front, front_z, real_at(begun.front_z, i));
        if FIRST || !kept || has_front {
            let index = select(0u, front, has_front);
            let plane = sized(splat_front(placed[index], omega), index);
            textureStore(layers, texel, gap_front(i32(gap)), select(vec4f(0.0), plane, has_front));
        }
        if !LAST {
            let kept_z = select(NOWHERE, back_z, kept);
            textureStore(state, texel, 2u * gap, vec4u(bitcast<u32>(kept_z)));
            textureStore(state, texel, 2u * gap + 1u, vec4u(bitcast<u32>(front_z)));
        }
    }
}

fn draw(tile: u32, local: vec2u, thread: u32, gap: u32) {
    let p = tile_at(tile) * TILE + local * vec2u(1u, ROWS);
    let last = vec2u(camera.size) - 1u;
    let u = vec2f(p) + 0.5;
    let x = camera_omega(u).x;
    let upper_y = rows_below(u);
    let lower_y = rows_below(u + vec2f(0.0, 4.0));
    let upper_split = textureLoad(splits, min(p, last) / CELL, 0)[gap];
    let lower_split = textureLoad(splits, min(p + vec2u(0u, PART), last) / CELL, 0)[gap];
    let entries = entries_of(tile);
    let upper_begun = initial(p, gap);
    var lower_begun = upper_begun;
    if PARTS > 1u {
        lower_begun = initial(p + vec2u(0u, PART), gap);
    }
    var upper = upper_begun;
    var lower = lower_begun;
    if STAGED {
        for (var base = entries.begin; base < entries.end; base += THREADS) {
            workgroupBarrier();
            if base + thread < entries.end {
                let index = list[base + thread];
                batch[thread] = placed[index];
                batch_indices[thread] = index;
            }
            workgroupBarrier();
            for (var k = 0u; k < min(THREADS, entries.end - base); k++) {
                consider(&upper, batch[k], batch_indices[k], x, upper_y, upper_split);
            }
        }
    } else {
        for (var i = entries.begin; i < entries.end; i++) {
            let index = list[i];
            let s = placed[index];
            consider(&upper, s, index, x, upper_y, upper_split);
            if PARTS > 1u {
                consider(&lower, s, index, x, lower_y, lower_split);
            }
        }
    }
    store(p, gap, upper_split, upper_begun, upper);
    if PARTS > 1u {
        store(p + vec2u(0u, PART), gap, lower_split, lower_begun, lower);
    }
}

// Draws the tiles with gaps, a workgroup for each.
@compute @workgroup_size(TILE, TILE / ROWS)
fn sides(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = group_index(group);
    let packed = gap_tiles.tiles[min(number, max(gap_tiles.count, 1u) - 1u)];
    let tile = (packed >> 16u) * params.tiles.x + (packed & 0xffffu);
    let drawn = number < gap_tiles.count && is_in_band(starts[tile]);
    for (var gap = 0u; gap < select(0u, GAPS, drawn); gap++) {
        draw(tile, local.xy, thread, gap);
    }
}
