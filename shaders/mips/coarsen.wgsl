// Mip levels of plane layers, for intersectors that read filtered planes.
//
// Disparity is linear in a plane's pi, so the mean of four pi is the plane of mean disparity and mean
// slope. Only planes of the nearest surface among the four are averaged: across a silhouette the mean
// would lie on no surface.
//
// The root that imports this file defines finer, coarser, finer_texel() and store_coarser().

// Largest relative depth difference and angle between texels of one surface.
const SAME_DEPTH: f32 = 0.02;
const SAME_ANGLE: f32 = 0.5;

@compute @workgroup_size(8, 8)
fn coarsen(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(coarser);
    if any(id.xy >= size) {
        return;
    }
    let last = vec2i(textureDimensions(finer)) - 1;
    let layer = i32(id.z);
    var texels: array<vec4f, 4>;
    var nearest = vec4f(0.0);
    for (var i = 0; i < 4; i++) {
        let p = min(2 * vec2i(id.xy) + vec2i(i & 1, i >> 1u), last);
        texels[i] = finer_texel(p, layer);
        // Without its flag.
        texels[i].w = abs(texels[i].w);
        // The depth at the texel's centre is in w, 0 where empty.
        if texels[i].w > 0.0 && (nearest.w == 0.0 || texels[i].w < nearest.w) {
            nearest = texels[i];
        }
    }
    var sum = vec4f(0.0);
    var count = 0.0;
    for (var i = 0; i < 4; i++) {
        let texel = texels[i];
        let same = distance(texel.xyz, nearest.xyz) <= SAME_ANGLE * length(nearest.xyz)
            && texel.w - nearest.w <= SAME_DEPTH * nearest.w;
        if texel.w > 0.0 && same {
            sum += texel;
            count += 1.0;
        }
    }
    store_coarser(id.xy, layer, sum / max(count, 1.0));
}
