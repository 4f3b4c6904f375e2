// Mip levels of a single-layer texture, which OpenGL cannot read as an array.

#import mips/coarsen.wgsl

@group(0) @binding(0) var finer: texture_2d<f32>;
@group(0) @binding(1) var coarser: texture_storage_2d<rgba32float, write>;

fn finer_texel(p: vec2i, layer: i32) -> vec4f {
    return textureLoad(finer, p, 0);
}

fn store_coarser(p: vec2u, layer: i32, value: vec4f) {
    textureStore(coarser, p, value);
}
