// Draws the splats in a list.

#import splat.wgsl

@group(2) @binding(0) var<storage, read> listed: array<u32>;

@vertex
fn vertex_listed(@builtin(vertex_index) vertex: u32) -> Varying {
    return splat_varying(vertex_corner(vertex), splats[listed[vertex / VERTICES]]);
}
