// The kernels of `simulation.rs`, behind its constants: DX is the side of a cell, m, and DT a step, s.

struct Particle {
    position: vec3f, // m
    velocity: vec3f, // m/s
    affine: mat3x3f, // of the velocities around it, 1/s
}

// Momentum and mass of a node, of particles of mass 1, in units of 1 / UNIT: integers sum to the same in any order.
struct Node {
    momentum: array<atomic<i32>, 3>,
    mass: atomic<i32>,
}

@group(0) @binding(0) var<storage, read_write> particles: array<Particle>;
@group(0) @binding(1) var<storage, read_write> grid: array<Node>;

const UNIT: f32 = 1048576.0;
const GRAVITY: f32 = 9.81;
// Speed of sound, m/s, and exponent of the equation of state.
const SOUND: f32 = 20.0;
const GAMMA: f32 = 7.0;
const WALL: f32 = 2.0;

// A random number of 0 to 1 (M. Jarzynski and M. Olano, Hash Functions for GPU Rendering, JCGT 2020).
fn random(i: u32) -> f32 {
    let state = i * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return f32((word >> 22u) ^ word) / 4294967296.0;
}

@compute @workgroup_size(64)
fn begin(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= COUNT {
        return;
    }
    let across = vec2u(DAM * pow(PER_CELL, 1.0 / 3.0));
    let lattice = vec3f(vec3u(id.x / (across.x * across.y), id.x % across.x, id.x / across.x % across.y));
    let jitter = 0.3 * (vec3f(random(3u * id.x), random(3u * id.x + 1u), random(3u * id.x + 2u)) - 0.5);
    particles[id.x].position = DX * (WALL + (lattice + 0.5 + jitter) * pow(PER_CELL, -1.0 / 3.0));
}

@compute @workgroup_size(64)
fn clear(@builtin(global_invocation_id) id: vec3u) {
    if id.x < arrayLength(&grid) {
        for (var axis = 0u; axis < 3u; axis++) {
            atomicStore(&grid[id.x].momentum[axis], 0);
        }
        atomicStore(&grid[id.x].mass, 0);
    }
}

// A particle's share of one of the 27 nodes around it: the node, the way to it, m, and the weight.
struct Share {
    node: u32,
    way: vec3f,
    weight: f32,
}

fn share(position: vec3f, i: u32) -> Share {
    let cell = position / DX;
    let first = vec3u(cell - 0.5);
    let steps = vec3u(i % 3u, i / 3u % 3u, i / 9u);
    let distance = vec3f(first + steps) - cell;
    // Quadratic B-spline.
    let d = abs(distance);
    let w = select(0.5 * (1.5 - d) * (1.5 - d), 0.75 - d * d, d < vec3f(0.5));
    let node = first + steps;
    return Share((node.z * CELLS.y + node.y) * CELLS.x + node.x, DX * distance, w.x * w.y * w.z);
}

fn add(node: u32, momentum: vec3f) {
    for (var axis = 0u; axis < 3u; axis++) {
        atomicAdd(&grid[node].momentum[axis], i32(round(UNIT * momentum[axis])));
    }
}

@compute @workgroup_size(64)
fn scatter_mass(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= COUNT {
        return;
    }
    let p = particles[id.x];
    for (var i = 0u; i < 27u; i++) {
        let to = share(p.position, i);
        add(to.node, to.weight * (p.velocity + p.affine * to.way));
        atomicAdd(&grid[to.node].mass, i32(round(UNIT * to.weight)));
    }
}

@compute @workgroup_size(64)
fn scatter_pressure(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= COUNT {
        return;
    }
    let position = particles[id.x].position;
    var density = 0.0;
    for (var i = 0u; i < 27u; i++) {
        let to = share(position, i);
        density += to.weight * f32(atomicLoad(&grid[to.node].mass)) / UNIT;
    }
    // Pressure over density; liquid does not pull.
    let compressed = min(density / PER_CELL, 1.3);
    let pressure = max(SOUND * SOUND / GAMMA * (pow(compressed, GAMMA) - 1.0), 0.0) / max(compressed, 1e-3);
    for (var i = 0u; i < 27u; i++) {
        let to = share(position, i);
        add(to.node, to.weight * DT * 4.0 / (DX * DX) * pressure * to.way);
    }
}

@compute @workgroup_size(64)
fn move_grid(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&grid) {
        return;
    }
    let mass = f32(atomicLoad(&grid[id.x].mass));
    let node = vec3u(id.x % CELLS.x, id.x / CELLS.x % CELLS.y, id.x / (CELLS.x * CELLS.y));
    for (var axis = 0u; axis < 3u; axis++) {
        var velocity = f32(atomicLoad(&grid[id.x].momentum[axis])) / max(mass, 1.0);
        velocity -= select(0.0, GRAVITY * DT, axis == 1u);
        let at = f32(node[axis]);
        velocity = select(velocity, max(velocity, 0.0), at <= WALL);
        velocity = select(velocity, min(velocity, 0.0), at >= f32(CELLS[axis]) - 1.0 - WALL);
        atomicStore(&grid[id.x].momentum[axis], i32(UNIT * clamp(velocity, -100.0, 100.0)));
    }
}

@compute @workgroup_size(64)
fn gather(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= COUNT {
        return;
    }
    var p = particles[id.x];
    p.velocity = vec3f(0.0);
    p.affine = mat3x3f();
    for (var i = 0u; i < 27u; i++) {
        let to = share(p.position, i);
        var velocity: vec3f;
        for (var axis = 0u; axis < 3u; axis++) {
            velocity[axis] = f32(atomicLoad(&grid[to.node].momentum[axis])) / UNIT;
        }
        p.velocity += to.weight * velocity;
        let scaled = to.weight * 4.0 / (DX * DX) * velocity;
        p.affine += mat3x3f(scaled * to.way.x, scaled * to.way.y, scaled * to.way.z);
    }
    let low = vec3f(DX * (WALL + 0.01));
    p.position = clamp(p.position + DT * p.velocity, low, DX * (vec3f(CELLS) - 1.01 - WALL));
    particles[id.x] = p;
}
