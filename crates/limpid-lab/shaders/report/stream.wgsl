// Memory bandwidth benchmark: copies one buffer into another.

@group(0) @binding(0) var<storage, read> source: array<vec4f>;
@group(0) @binding(1) var<storage, read_write> copied: array<vec4f>;

// Workgroup size. Each thread copies four elements, as in `crates/limpid-lab/src/report/rates.rs`.
const THREADS: u32 = 256u;

@compute @workgroup_size(THREADS)
fn stream(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) thread: u32) {
    let first = 4u * THREADS * group.x + thread;
    let a = source[first];
    let b = source[first + THREADS];
    let c = source[first + 2u * THREADS];
    let d = source[first + 3u * THREADS];
    copied[first] = a;
    copied[first + THREADS] = b;
    copied[first + 2u * THREADS] = c;
    copied[first + 3u * THREADS] = d;
}
