// Marks the bins of depth that swollen splats touch along the rays of each tile's cells.

#import splat/lists.wgsl
#import gaps/cells.wgsl

@group(3) @binding(0) var layers: $layers;
@group(3) @binding(1) var<storage, read_write> marks: array<u32>;

override ALONE: bool = true; // the class has one chunk; otherwise marks are 0 at first

const CELLS: u32 = CELLS_PER_TILE * CELLS_PER_TILE;

var<workgroup> found: array<atomic<u32>, CELLS * WORDS>;

// The bits of a word that stand for bins before `end`.
fn bits_up_to(end: u32, word: u32) -> u32 {
    let bits = clamp(i32(end) - i32(32u * word), 0, 32);
    return select((1u << u32(bits & 31)) - 1u, 0xffffffffu, bits == 32);
}

// Bins of a splat along a ray, between the first front and the last back.
fn bins_of(s: ViewSplat, omega: vec3f, range: vec2f) -> array<u32, WORDS> {
    var words = array<u32, WORDS>();
    let chord = splat_chord(s, omega);
    let swollen = CLOSING * CLOSING - dot(chord.f, chord.f);
    let half = sqrt(max(swollen, 0.0) / dot(chord.d, chord.d));
    let per_metre = f32(BINS) / (range.y - range.x);
    let low = (chord.middle - half - range.x) * per_metre;
    let high = (chord.middle + half - range.x) * per_metre;
    if swollen < 0.0 || chord.middle + half < camera.near || high < 0.0 || low >= f32(BINS) {
        return words;
    }
    let low_bin = u32(max(low, 0.0));
    let high_bin = u32(min(high, f32(BINS) - 1.0));
    for (var word = 0u; word < WORDS; word++) {
        words[word] = bits_up_to(high_bin + 1u, word) & ~bits_up_to(low_bin, word);
    }
    return words;
}

// The threads share the cells, and those of a cell its list.
fn mark_tile(tile: u32, thread: u32) {
    if thread < CELLS * WORDS {
        atomicStore(&found[thread], 0u);
    }
    workgroupBarrier();
    let size = vec2u(camera.size);
    let entries = entries_of(tile);
    let cell = thread % CELLS;
    let xy = tile_at(tile) * CELLS_PER_TILE + vec2u(cell % CELLS_PER_TILE, cell / CELLS_PER_TILE);
    let texel = min(cell_texel(xy), size - 1u);
    let range = vec2f(textureLoad(layers, texel, FRONT$level).w, textureLoad(layers, texel, BACK$level).w);
    let omega = camera_omega(vec2f(texel) + 0.5);
    var words = array<u32, WORDS>();
    let end = select(entries.begin, entries.end, range.x > 0.0 && range.y > range.x);
    for (var i = entries.begin + thread / CELLS; i < end; i += THREADS / CELLS) {
        let of_splat = bins_of(placed[list[i]], omega, range);
        for (var word = 0u; word < WORDS; word++) {
            words[word] |= of_splat[word];
        }
    }
    for (var word = 0u; word < WORDS; word++) {
        atomicOr(&found[cell * WORDS + word], words[word]);
    }
    workgroupBarrier();
    let across = cells_across(size.x);
    if thread < CELLS && all(xy * CELL < size) {
        for (var word = 0u; word < WORDS; word++) {
            let at = (xy.y * across + xy.x) * WORDS + word;
            let marked = atomicLoad(&found[cell * WORDS + word]);
            if ALONE {
                marks[at] = marked;
            } else {
                marks[at] |= marked;
            }
        }
    }
    workgroupBarrier();
}

@compute @workgroup_size(THREADS)
fn mark(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let tile = busy_tile(group);
    if tile != NO_TILE {
        mark_tile(tile, thread);
    }
}
