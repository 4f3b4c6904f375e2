// Marks the cells of listed splats by drawing them.

#import gaps/mark.wgsl

@group(2) @binding(0) var<storage, read> listed: array<u32>;

@vertex
fn vertex_cells(@builtin(vertex_index) vertex: u32) -> Varying {
    let corner = vertex_corner(vertex);
    var out = splat_varying(corner, swollen(splats[listed[vertex / VERTICES]]));
    // The middle of a cell's texel is half a texel from the middle of the cell.
    let sign = vec2f(f32(corner & 1u), f32(corner >> 1u)) * 2.0 - 1.0;
    out.clip = vec4f(out.clip.xy + sign / camera.size, 0.5, 1.0);
    return out;
}

@fragment
fn mark_large(in: Varying) {
    mark_cell(vec2u(in.clip.xy), in.centre, varying_to_sphere(in));
}
