// Blur of the caustic map, which approximates an area light: a Gaussian along one axis over texels of
// the same receiver.

#import common/camera.wgsl
#import common/layers.wgsl
#import caustics/params.wgsl

@group(1) @binding(0) var<$branching> caustics: CausticParams;
@group(1) @binding(1) var unblurred: texture_2d<f32>;
@group(1) @binding(2) var receivers: texture_2d<f32>;
@group(1) @binding(3) var blurred: texture_storage_2d<rgba32float, write>;

// Axis: vertical if true.
override DOWN: bool = false;

// Largest distance between the planes of two texels on the same receiver, in texels.
const SAME_RECEIVER: f32 = 1.0;

@compute @workgroup_size(8, 8)
fn blur(@builtin(global_invocation_id) id: vec3u) {
    let p = vec2i(id.xy + caustics.first);
    let size = vec2i(camera.size);
    if any(p >= size) {
        return;
    }
    let own = textureLoad(receivers, p, 0).xyz;
    let omega = camera_omega(vec2f(p) + 0.5);
    let texel = 2.0 * camera.tangent.x / camera.size.x * select(dot(own, omega), 1.0, ORTHOGRAPHIC);
    let slope = plane_slope(own);
    let axis = select(vec2i(1, 0), vec2i(0, 1), DOWN);
    // Limited to the map, which may be much smaller than the kernel.
    let along = select(p.x, p.y, DOWN);
    let last = select(size.x, size.y, DOWN) - 1;
    let reach = i32(min(ceil(3.0 * caustics.blur), f32(last)));
    var sum = vec3f(0.0);
    var weight = 0.0;
    for (var i = max(-reach, -along); i <= min(reach, last - along); i++) {
        let q = p + i * axis;
        let there = textureLoad(receivers, q, 0).xyz;
        let miss = abs(dot(there - own, camera_omega(vec2f(q) + 0.5)));
        if miss <= SAME_RECEIVER * (texel + abs(slope.x) + abs(slope.y)) {
            let x = f32(i) / caustics.blur;
            let w = exp(-0.5 * x * x);
            sum += w * textureLoad(unblurred, q, 0).rgb;
            weight += w;
        }
    }
    let share = textureLoad(unblurred, p, 0).a;
    textureStore(blurred, p, vec4f(sum / max(weight, 1e-20), share));
}
