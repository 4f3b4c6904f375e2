// A grid of cells in the world, for rays that are not the eye's: foam, spray and bubbles that liquid mirrors, and those seen
// through more than its first surface. They see the spheres of a cell as a cloud.
//
// `fill_cells` adds the areas of the spheres' discs; sums of integers do not depend on the order. `light_cells` turns them into
// optical depth, of a way along the side of a cell, and radiance, in the air and in the liquid. Behind the cells, a word for each
// brick of 4 x 4 x 4 of them tells whether it has any.

#import diffuse/light.wgsl
#import diffuse/particles.wgsl
#import diffuse/pixels.wgsl

@group(1) @binding(2) var<storage, read_write> cells: array<array<u32, 4>>;

// Units of optical depth while it is added.
const CELL_UNITS: f32 = 262144.0;
// Share of light from one direction that a Lambertian sphere reflects to all directions, over that which faces it.
const MEAN_PHASE: f32 = 0.25;

@compute @workgroup_size(64)
fn light_cells(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) local: u32) {
    let index = thread_index(group, local);
    let across = params.cells_across;
    if index >= across.x * across.y * across.z {
        return;
    }
    // By kind.
    let sums = vec4u(cells[index][0], cells[index][1], cells[index][2], cells[index][3]);
    let depths = vec4f(sums) / CELL_UNITS;
    if all(depths == vec4f(0.0)) {
        return;
    }
    let cell = vec3u(index % across.x, (index / across.x) % across.y, index / (across.x * across.y));
    let x = params.cells_first + params.cells_side * (vec3f(cell) + 0.5);
    var light = irradiance_near(camera_pixel(camera_view_direction(x)), MEAN);
    for (var i = 0u; i < LIGHTS; i++) {
        let to_light = light_from(lights[i], x);
        light += MEAN_PHASE * direct_light(i, x, 0.0, to_light, params.albedos[0].rgb);
    }
    light /= params.white;
    let air = depths.x * params.albedos[0].rgb + depths.y * params.albedos[1].rgb;
    let liquid = depths.z * params.albedos[2].rgb + depths.w * params.albedos[3].rgb;
    let own = vec2f(depths.x + depths.y, depths.z + depths.w);
    let colors = vec2u(pack_color(light * air / max(own.x, 1e-9)), pack_color(light * liquid / max(own.y, 1e-9)));
    cells[index] = array<u32, 4>(bitcast<u32>(own.x), colors.x, bitcast<u32>(own.y), colors.y);
    let bricks = (across + 3u) / 4u;
    let brick = cell / 4u;
    let number = (brick.z * bricks.y + brick.y) * bricks.x + brick.x;
    // All cells of a brick write the same.
    cells[across.x * across.y * across.z + number / 4u][number % 4u] = 1u;
}
