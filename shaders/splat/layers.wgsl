// Nearest fronts and farthest backs of a class of splats.
//
// Each tile's threads run through its list. Depths decide and, at equal depths, the lower index, so that the order of
// the list does not matter. Splats that exceed one binding are drawn in chunks: `state` holds the depths between them.

#import splat/lists.wgsl
#import common/sizes.wgsl

@group(1) @binding(0) var<storage, read> splats: array<Splat>;
@group(3) @binding(0) var layers: texture_storage_2d_array<rgba32float, write>;
@group(3) @binding(1) var tags: texture_storage_2d<rgba32uint, write>;
// Depths of fronts and backs.
@group(3) @binding(2) var state: texture_storage_2d_array<r32uint, read_write>;

override BACKS: bool = true;  // draw backs
override SIZES: bool = false; // radii differ, so that planes bear sizes: common/sizes.wgsl
override TAGS: bool = false;  // write the particle, from 1, and fluid of each front
override FIRST: bool = true;  // no chunk is before
override LAST: bool = true;   // no chunk follows

var<workgroup> batch: array<ViewSplat, THREADS>;
var<workgroup> batch_indices: array<u32, THREADS>;

// Depths and indices of the nearest front and the farthest back of a part's pixels.
struct Sides {
    front_z: Real,
    back_z: Real,
    front: Index,
    back: Index,
}

fn consider(sides: ptr<function, Sides>, s: ViewSplat, index: u32, x: f32, y: Real) {
    let chords = chords_of(s, x, y);
    let half = half_length(chords, 1.0);
    let near = Real(camera.near);
    let last = chords.middle + half;
    let first = max(chords.middle - half, near);
    let hit = (chords.f2 <= Real(1.0)) & (last >= near);
    let i = Index(index);
    let before = (*sides);
    let nearer = hit & ((first < before.front_z) | ((first == before.front_z) & (i < before.front)));
    (*sides).front_z = select(before.front_z, first, nearer);
    (*sides).front = select(before.front, i, nearer);
    if BACKS {
        let farther = hit & ((last > before.back_z) | ((last == before.back_z) & (i < before.back)));
        (*sides).back_z = select(before.back_z, last, farther);
        (*sides).back = select(before.back, i, farther);
    }
}

// Where no chunk is before, nothing; otherwise the depths of those, which no index may replace at equal depths.
fn initial(p: vec2u) -> Sides {
    if FIRST {
        return Sides(Real(NOWHERE), Real(0.0), Index(NONE), Index(NONE));
    }
    var front: array<f32, 4>;
    var back: array<f32, 4>;
    for (var i = 0u; i < PART; i++) {
        let texel = min(p + vec2u(0u, i), vec2u(camera.size) - 1u);
        front[i] = bitcast<f32>(textureLoad(state, texel, 0).x);
        back[i] = bitcast<f32>(textureLoad(state, texel, 1).x);
    }
    let front_z = each_real(front[0], front[1], front[2], front[3]);
    let back_z = each_real(back[0], back[1], back[2], back[3]);
    return Sides(front_z, back_z, Index(0u), Index(0u));
}

// The index that initial sides without a splat of this chunk have.
fn is_found(index: u32, z: f32, initial_z: f32) -> bool {
    return select(z != initial_z, index != NONE, FIRST);
}

fn store(p: vec2u, begun: Sides, sides: Sides) {
    for (var i = 0u; i < PART; i++) {
        let texel = p + vec2u(0u, i);
        if any(texel >= vec2u(camera.size)) {
            continue;
        }
        let omega = camera_omega(vec2f(texel) + 0.5);
        let front_z = real_at(sides.front_z, i);
        let front = index_at(sides.front, i);
        let has_front = is_found(front, front_z, real_at(begun.front_z, i));
        if FIRST || has_front {
            // Software adapters execute both sides of a branch: one store for both.
            let index = select(0u, front, has_front);
            let plane = sized(splat_front(placed[index], omega), index);
            textureStore(layers, texel, 0, select(vec4f(0.0), plane, has_front));
            if TAGS {
                let splat = splats[index];
                let tag = vec4u(splat.particle + 1u, splat.tags & FLUID, 0u, 0u);
                textureStore(tags, texel, select(vec4u(0u), tag, has_front));
            }
        }
        let back_z = real_at(sides.back_z, i);
        let back = index_at(sides.back, i);
        let has_back = BACKS && is_found(back, back_z, real_at(begun.back_z, i));
        if FIRST || has_back {
            var plane = vec4f(0.0);
            if BACKS {
                let index = select(0u, back, has_back);
                plane = select(plane, sized(splat_back(placed[index], omega), index), has_back);
            }
            textureStore(layers, texel, 1, plane);
        }
        if !LAST {
            textureStore(state, texel, 0, vec4u(bitcast<u32>(front_z)));
            textureStore(state, texel, 1, vec4u(bitcast<u32>(back_z)));
        }
    }
}

// A plane with the size of its particle, where sizes differ.
fn sized(plane: vec4f, index: u32) -> vec4f {
    if SIZES {
        return vec4f(with_particle_size(plane.xyz, particle_size_of(splats[index].radius)), plane.w);
    }
    return plane;
}

fn draw(tile: u32, local: vec2u, thread: u32) {
    let p = tile_at(tile) * TILE + local * vec2u(1u, ROWS);
    let u = vec2f(p) + 0.5;
    let x = camera_omega(u).x;
    let upper_y = rows_below(u);
    let lower_y = rows_below(u + vec2f(0.0, 4.0));
    let entries = entries_of(tile);
    let upper_begun = initial(p);
    var lower_begun = upper_begun;
    if PARTS > 1u {
        lower_begun = initial(p + vec2u(0u, PART));
    }
    var upper = upper_begun;
    var lower = lower_begun;
    if STAGED {
        for (var base = entries.begin; base < entries.inner_end; base += THREADS) {
            workgroupBarrier();
            if base + thread < entries.inner_end {
                let index = list[base + thread];
                batch[thread] = placed[index];
                batch_indices[thread] = index;
            }
            workgroupBarrier();
            for (var k = 0u; k < min(THREADS, entries.inner_end - base); k++) {
                consider(&upper, batch[k], batch_indices[k], x, upper_y);
            }
        }
    } else {
        for (var i = entries.begin; i < entries.inner_end; i++) {
            let index = list[i];
            let s = placed[index];
            consider(&upper, s, index, x, upper_y);
            if PARTS > 1u {
                consider(&lower, s, index, x, lower_y);
            }
        }
    }
    store(p, upper_begun, upper);
    if PARTS > 1u {
        store(p + vec2u(0u, PART), lower_begun, lower);
    }
}

@compute @workgroup_size(TILE, TILE / ROWS)
fn layers_of_tiles(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let tile = busy_tile(group);
    if tile != NO_TILE {
        draw(tile, local.xy, thread);
    }
}
