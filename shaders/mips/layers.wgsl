// Mip levels of an array texture.

#import mips/coarsen.wgsl

@group(0) @binding(0) var finer: texture_2d_array<f32>;
@group(0) @binding(1) var coarser: texture_storage_2d_array<rgba32float, write>;

fn finer_texel(p: vec2i, layer: i32) -> vec4f {
    return textureLoad(finer, p, layer, 0);
}

fn store_coarser(p: vec2u, layer: i32, value: vec4f) {
    textureStore(coarser, p, layer, value);
}
