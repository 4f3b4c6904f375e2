// Lists the pixels with liquid around which the picture has structure: there its second difference exceeds a share of
// the radiance. On a slope of the picture one ray is the mean of many.

#import common/camera.wgsl
#import common/tiles.wgsl
#import refract/lists.wgsl
#import refract/slabs.wgsl

struct Params {
    structure: f32, // least second difference, as a share of the largest radiance
}

@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var aggregate_layers: $layers;
@group(1) @binding(2) var splash_layers: $layers;
@group(1) @binding(3) var radiance: texture_2d<f32>; // with one ray per pixel
@group(1) @binding(4) var<storage, read> tiles: TileList;

@compute @workgroup_size(8, 8)
fn find(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = group_index(group);
    if index >= tiles.count {
        return;
    }
    let p = tile_pixel(tiles.tiles[index], local.xy);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    if has_liquid(p) && has_structure(p) {
        is_deferred(p);
    }
}

fn has_structure(p: vec2i) -> bool {
    let middle = seen(p);
    var most = middle;
    var bend = vec4f(0.0);
    for (var axis = 0; axis < 2; axis++) {
        let step = select(vec2i(1, 0), vec2i(0, 1), axis == 1);
        let before = seen(p - step);
        let after = seen(p + step);
        most = max(most, max(before, after));
        bend = max(bend, abs(before + after - 2.0 * middle));
    }
    let brightest = max(most.r, max(most.g, most.b));
    return any(bend.rgb > vec3f(params.structure * brightest)) || bend.a > params.structure;
}

// Radiance and coverage of the pixel, at the border of the next one in the picture.
fn seen(p: vec2i) -> vec4f {
    return textureLoad(radiance, clamp(p, vec2i(0), vec2i(camera.size) - 1), 0);
}
