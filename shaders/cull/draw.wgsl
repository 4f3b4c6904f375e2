// Draws the splats in a list.

#import splat.wgsl

@group(2) @binding(0) var<storage, read> listed: array<u32>;

@vertex
fn vertex_listed(
    @builtin(vertex_index) corner: u32,
    @builtin(instance_index) instance: u32,
) -> Varying {
    return splat_varying(corner, splats[listed[instance]]);
}
