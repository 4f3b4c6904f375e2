// Mixture of fluids at each pixel: sums over all splats of the chord length along the pixel's ray, and
// of absorption times length. Their quotient is the mean absorption along the ray.
//
// Sums are integers, so that they do not depend on the order of the lists.

#import splat/lists.wgsl

const MAX_FLUIDS: u32 = 16u;

@group(1) @binding(0) var<storage, read> splats: array<Splat>;
// Absorption of each fluid, relative to the largest component of all, and in w the inverse particle
// radius, 1/m.
@group(3) @binding(0) var<uniform> absorptions: array<vec4f, MAX_FLUIDS>;
@group(3) @binding(1) var mixture: texture_storage_2d<rgba16float, write>;
// The sums of the classes and chunks before, in tiles that are summed already.
@group(3) @binding(2) var state: texture_storage_2d_array<r32uint, read_write>;
@group(3) @binding(3) var<storage, read_write> summed: array<u32>;

// Parts of a particle radius in which lengths are counted, and the most that one splat adds.
const UNIT: f32 = 65536.0;
const MOST: f32 = 0x1p31f;

var<workgroup> batch: array<ViewSplat, THREADS>;
var<workgroup> batch_fluids: array<u32, THREADS>;

// Of a part's pixels.
struct Sums {
    red: Index,
    green: Index,
    blue: Index,
    length: Index,
}

fn saturated(a: Index, length: Real) -> Index {
    let sum = a + Index(min(UNIT * length, Real(MOST)) + 0.5);
    return select(sum, Index(0xffffffffu), sum < a);
}

fn add(sums: ptr<function, Sums>, s: ViewSplat, fluid: u32, x: f32, y: Real) {
    let chords = chords_of(s, x, y);
    let half = half_length(chords, 1.0);
    let hit = (chords.f2 <= Real(1.0)) & (chords.middle + half >= Real(camera.near));
    // Length in depth, which is proportional along a ray, and in particle radii, so that half floats
    // hold it at any scene scale.
    let absorption = absorptions[fluid];
    let length = select(Real(0.0), half * absorption.w, hit);
    (*sums).red = saturated((*sums).red, length * absorption.x);
    (*sums).green = saturated((*sums).green, length * absorption.y);
    (*sums).blue = saturated((*sums).blue, length * absorption.z);
    (*sums).length = saturated((*sums).length, length);
}

fn store(p: vec2u, sums: Sums, add_to_state: bool) {
    for (var i = 0u; i < PART; i++) {
        let texel = p + vec2u(0u, i);
        if any(texel >= vec2u(camera.size)) {
            continue;
        }
        var sum = vec4u(index_at(sums.red, i), index_at(sums.green, i), index_at(sums.blue, i), index_at(sums.length, i));
        for (var k = 0u; k < 4u; k++) {
            let before = select(0u, textureLoad(state, texel, k).x, add_to_state);
            sum[k] = select(before + sum[k], 0xffffffffu, before + sum[k] < before);
            textureStore(state, texel, k, vec4u(sum[k]));
        }
        textureStore(mixture, texel, vec4f(sum) / UNIT);
    }
}

fn draw(tile: u32, local: vec2u, thread: u32) {
    let p = tile_at(tile) * TILE + local * vec2u(1u, ROWS);
    let u = vec2f(p) + 0.5;
    let x = camera_omega(u).x;
    let upper_y = rows_below(u);
    let lower_y = rows_below(u + vec2f(0.0, 4.0));
    let entries = entries_of(tile);
    var upper = Sums(Index(0u), Index(0u), Index(0u), Index(0u));
    var lower = upper;
    if STAGED {
        for (var base = entries.begin; base < entries.inner_end; base += THREADS) {
            workgroupBarrier();
            if base + thread < entries.inner_end {
                let index = list[base + thread];
                batch[thread] = placed[index];
                batch_fluids[thread] = splats[index].tags & FLUID;
            }
            workgroupBarrier();
            for (var k = 0u; k < min(THREADS, entries.inner_end - base); k++) {
                add(&upper, batch[k], batch_fluids[k], x, upper_y);
            }
        }
    } else {
        for (var i = entries.begin; i < entries.inner_end; i++) {
            let index = list[i];
            let s = placed[index];
            let fluid = splats[index].tags & FLUID;
            add(&upper, s, fluid, x, upper_y);
            if PARTS > 1u {
                add(&lower, s, fluid, x, lower_y);
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
fn mixture_of_tiles(
    @builtin(workgroup_id) group: vec3u,
    @builtin(local_invocation_id) local: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let tile = busy_tile(group);
    if tile != NO_TILE {
        draw(tile, local.xy, thread);
    }
}
