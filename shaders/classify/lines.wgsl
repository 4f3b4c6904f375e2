// The lines on which the iso-surface is looked for: out of the liquid, and to both sides of a sheet. Listed by cell, one
// thread per cell, so that the lines of a row of cells are one run.

#import classify/line.wgsl
#import classify/sheets.wgsl
#import common/splat.wgsl

@group(0) @binding(1) var<storage, read> starts: array<u32>;
@group(0) @binding(2) var<storage, read> order: array<vec2u>;   // member, and cell with its mark
@group(0) @binding(3) var<storage, read> means: array<vec4f>;   // in h, and share of a sheet
@group(0) @binding(4) var<storage, read> splats: array<Splat>;
@group(0) @binding(5) var<storage, read> line_starts: array<u32>;
@group(0) @binding(6) var<storage, read_write> line_counts: array<u32>;
@group(0) @binding(7) var<storage, read_write> lines: array<Line>;

@compute @workgroup_size(64)
fn count_lines(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let cell = group_index(group) * 64u + local;
    if cell >= params.cells || crowded() {
        return;
    }
    var count = 0u;
    for (var slot = starts[cell]; slot < starts[cell + 1u]; slot++) {
        count += u32(goes_out(means[slot])) + 2u * u32(has_sides(means[slot]));
    }
    line_counts[cell] = count;
}

@compute @workgroup_size(64)
fn list_lines(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let cell = group_index(group) * 64u + local;
    if cell >= params.cells || crowded() {
        return;
    }
    var line = line_starts[cell];
    for (var slot = starts[cell]; slot < starts[cell + 1u]; slot++) {
        let mean = means[slot];
        if goes_out(mean) && line < params.most_lines {
            lines[line] = Line(-normalize(mean.xyz), (slot << 2u) | OUT);
        }
        line += u32(goes_out(mean));
        if has_sides(mean) && line + 1u < params.most_lines {
            let splat = splats[order[slot].x];
            let axis = sheet(mean.xyz, eigen(Symmetric(splat.diagonal, splat.off_diagonal))).xyz;
            lines[line] = Line(axis, (slot << 2u) | SIDE);
            lines[line + 1u] = Line(-axis, (slot << 2u) | OTHER_SIDE);
        } else if has_sides(mean) && line < params.most_lines {
            lines[line] = Line(vec3f(0.0), NO_LINE);
        }
        line += 2u * u32(has_sides(mean));
    }
}
