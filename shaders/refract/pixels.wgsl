// Entry points of refraction: pixels with liquid, pixels without, and the edges among these.
//
// A root defines what refract/looks.wgsl needs, and
//     fn trace(u: vec2f, texel: vec2i) -> vec4f
//         Radiance and coverage of the ray through pixel position `u` of a texel with liquid.

#import common/camera.wgsl
#import common/layers.wgsl
#import common/samples.wgsl
#import common/scene.wgsl
#import common/tiles.wgsl
#import refract/bindings.wgsl
#import refract/diffuse.wgsl
#import refract/lists.wgsl
#import refract/looks.wgsl

override COUNT: bool = false;     // write the diagnostics
override EDGE_SAMPLES: u32 = 16u; // rays per edge pixel without liquid

// Relative difference of radiance that distinguishes an edge from shading, and from the light through liquid where patterns
// are filtered.
const EDGE: f32 = 0.02;
const FILTERED_EDGE: f32 = 0.1;

// Radiance along a ray beside the liquid, and values that tell it from its neighbours across an edge.
struct Background {
    seen: vec4f,
    compared: vec4f, // radiance and coverage; where patterns are filtered, without them, and with the solid's number
}

fn background_ray(u: vec2f) -> Background {
    let omega = camera_omega(u);
    let o = camera_ray_origin(omega);
    let d = camera_ray_direction(omega);
    let solid = solid_ahead(o, d);
    without_pattern = vec3f(0.0);
    let radiance = vec4f(radiance_of(solid, o, d, vec3f(1.0), 0.0, Spread()), 1.0);
    let seen = select(radiance, vec4f(0.0), TRANSPARENT && solid.t >= NOTHING);
    let number = select(0.0, f32(solid.index + 1u), FILTER_PATTERNS && solid.t < NOTHING);
    return Background(seen, seen + vec4f(without_pattern, number));
}

fn background_mean(p: vec2i, count: u32) -> vec4f {
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        sum += background_ray(vec2f(p) + sample_offset(i, count)).seen;
    }
    return sum / f32(count);
}

// Draws a pixel without liquid. If its corners and centre differ, it contains an edge (T. Whitted, An
// Improved Illumination Model for Shaded Display, 1980) and gets many rays, which is affordable: they
// are short, and few pixels contain edges.
//
// One loop for all rays: drivers inline the shading where it is called, and compile it as often.
fn draw_background(p: vec2i) {
    if COUNT {
        textureStore(diagnostics, p, vec4f(0.0));
    }
    if HOST {
        let drawn = vec4f(textureLoad(host_color, p, 0).rgb, 1.0);
        textureStore(radiance, p, behind_spheres(p, select(drawn, vec4f(0.0), TRANSPARENT)));
        return;
    }
    if EDGE_SAMPLES <= SAMPLES {
        textureStore(radiance, p, behind_spheres(p, background_mean(p, SAMPLES)));
        return;
    }
    var low = vec4f(NOTHING);
    var high = vec4f(0.0);
    var sum = vec4f(0.0);
    for (var probe = 0u; probe < 5u + EDGE_SAMPLES; probe++) {
        var at = vec2f(vec2u(probe & 1u, probe >> 1u));
        if probe >= 5u {
            at = sample_offset(probe - 5u, EDGE_SAMPLES);
        }
        let ray = background_ray(vec2f(p) + select(at, vec2f(0.5), probe == 4u));
        if probe < 5u {
            low = min(low, ray.compared);
            high = max(high, ray.compared);
        } else {
            sum += ray.seen;
        }
        if probe == 4u && (is_flat(p, ray.seen, low, high) || is_deferred(p)) {
            return;
        }
    }
    textureStore(radiance, p, behind_spheres(p, sum / f32(EDGE_SAMPLES)));
}

// Draws a pixel in the colour of its centre if its probes see one solid and hardly differ: by `Background.compared`.
fn is_flat(p: vec2i, centre: vec4f, low: vec4f, high: vec4f) -> bool {
    let even = all(high.rgb - low.rgb <= select(EDGE, FILTERED_EDGE, FILTER_PATTERNS) * high.rgb);
    let flat = even && high.w == low.w;
    if flat {
        textureStore(radiance, p, behind_spheres(p, centre));
    }
    return flat;
}

// Pixels without liquid that contain an edge, which the other entry points defer.
@compute @workgroup_size(64)
fn edge_pixels(@builtin(global_invocation_id) id: vec3u) {
    for (var i = id.x; i < listed_count(); i += listed_threads()) {
        let p = listed_pixel(i);
        textureStore(radiance, p, behind_spheres(p, background_mean(p, EDGE_SAMPLES)));
    }
}

// Whether solids hide the liquid over the whole pixel, tested at its centre and corners. The front's
// plane may be steep at a rim, so a solid in front of its depth at the centre suffices.
fn is_hidden(p: vec2i) -> bool {
    if SOLIDS == 0u && !HOST && !OPAQUE_FLUIDS {
        return false;
    }
    let middle = camera_omega(vec2f(p) + 0.5);
    var front = textureLoad(aggregate_layers, p, FRONT$level).xyz;
    if SPLASH {
        let splash = textureLoad(splash_layers, p, FRONT$level).xyz;
        front = select(front, splash, dot(splash, middle) > dot(front, middle));
    }
    let disparity = dot(front, middle);
    for (var probe = 0; probe < 5; probe++) {
        let corner = vec2f(vec2i(probe & 1, (probe >> 1u) & 1));
        let omega = camera_omega(vec2f(p) + select(corner, vec2f(0.5), probe == 0));
        let solid = first_solid(omega, p);
        if camera_disparity_at(omega, solid.t) < min(disparity, dot(front, omega)) {
            return false;
        }
    }
    return true;
}

@compute @workgroup_size(8, 8)
fn refract_pixels(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = group_index(group);
    if index >= tiles.count {
        return;
    }
    let p = tile_pixel(tiles.tiles[index], local.xy);
    if any(p >= vec2i(camera.size)) {
        return;
    }
    // A solid in front of the liquid is drawn like one without liquid.
    if !has_liquid(p) || is_hidden(p) {
        draw_background(p);
        return;
    }
    var sum = vec4f(0.0);
    diagnosed = Diagnostics();
    for (var i = 0u; i < SAMPLES; i++) {
        sum += behind_spheres(p, trace(vec2f(p) + sample_offset(i, SAMPLES), p));
        if HOST && i == 0u {
            atomicAdd(&listed.looks, u32(diagnosed.looks));
            atomicAdd(&listed.fallbacks, u32(diagnosed.fallbacks));
        }
    }
    store_liquid(p, sum, SAMPLES);
}

// Pixels with liquid whose picture has structure (structure.wgsl): their first ray is known, and followed by others.
@compute @workgroup_size(64)
fn structured_pixels(@builtin(global_invocation_id) id: vec3u) {
    for (var k = id.x; k < listed_count(); k += listed_threads()) {
        let p = listed_pixel(k);
        if is_hidden(p) {
            continue;
        }
        var sum = textureLoad(first_radiance, p, 0);
        diagnosed = Diagnostics();
        for (var i = 1u; i < SAMPLES; i++) {
            sum += behind_spheres(p, trace(vec2f(p) + further_offset(i, SAMPLES), p));
        }
        store_liquid(p, sum, SAMPLES - 1u);
    }
}

// Stores the mean of all samples; the diagnostics are sums over `rays` of them.
fn store_liquid(p: vec2i, sum: vec4f, rays: u32) {
    let mean = sum / f32(SAMPLES);
    textureStore(radiance, p, vec4f(mean.rgb, select(1.0, mean.a, TRANSPARENT)));
    if COUNT {
        let d = diagnosed;
        let sums = vec4f(d.interfaces, d.inside, d.iterations, d.failures);
        textureStore(diagnostics, p, sums / f32(max(rays, 1u)));
    }
}

@compute @workgroup_size(8, 8)
fn background_pixels(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let index = group_index(group);
    if index >= tiles.count {
        return;
    }
    let p = tile_pixel(tiles.tiles[index], local.xy);
    if EDGE_SAMPLES <= SAMPLES || HOST {
        if all(p < vec2i(camera.size)) {
            draw_background(p);
        }
        return;
    }
    // Adjacent pixels share corners: each thread shades one and the centre of its pixel, and 17 threads another corner on the
    // far sides. One loop, as in `draw_background`; software adapters skip its last turn in groups of threads without one.
    let thread = i32(local.y) * 8 + i32(local.x);
    let first = p - vec2i(local.xy);
    let far = select(vec2i(8, thread), vec2i(thread - 9, 8), thread >= 9);
    var centre: Background;
    for (var k = 0; k < select(2, 3, thread < 17); k++) {
        let corner = vec2f(select(p, first + far, k == 2));
        let ray = background_ray(corner + select(0.0, 0.5, k == 1));
        if k == 1 {
            centre = ray;
        } else {
            tile_corners[select(thread + i32(local.y), far.y * 9 + far.x, k == 2)] = ray.compared;
        }
    }
    workgroupBarrier();
    if any(p >= vec2i(camera.size)) {
        return;
    }
    if COUNT {
        textureStore(diagnostics, p, vec4f(0.0));
    }
    let at = i32(local.y) * 9 + i32(local.x);
    var low = centre.compared;
    var high = centre.compared;
    for (var k = 0; k < 4; k++) {
        let corner = tile_corners[at + (k & 1) + 9 * (k >> 1u)];
        low = min(low, corner);
        high = max(high, corner);
    }
    if !is_flat(p, centre.seen, low, high) && !is_deferred(p) {
        textureStore(radiance, p, behind_spheres(p, background_mean(p, EDGE_SAMPLES)));
    }
}

// `Background.compared` at the corners of a tile's pixels, by rows.
var<workgroup> tile_corners: array<vec4f, 81>;
