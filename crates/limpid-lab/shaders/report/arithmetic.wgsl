// Arithmetic throughput benchmark: only multiply-adds, in sixteen independent chains.

@group(0) @binding(0) var<storage, read_write> result: array<vec4f>;

// Rounds per thread, as in `crates/limpid-lab/src/report/rates.rs`.
const ROUNDS: u32 = 32u;

const FACTOR = vec4f(0.999, 0.998, 0.997, 0.996);
const TERM = vec4f(1e-3, 2e-3, 3e-3, 4e-3);

// Eight multiply-adds of a chain, unrolled: a loop iteration costs more than one of them.
fn eight(start: vec4f) -> vec4f {
    var x = start * FACTOR + TERM;
    x = x * FACTOR + TERM;
    x = x * FACTOR + TERM;
    x = x * FACTOR + TERM;
    x = x * FACTOR + TERM;
    x = x * FACTOR + TERM;
    x = x * FACTOR + TERM;
    return x * FACTOR + TERM;
}

@compute @workgroup_size(64)
fn arithmetic(@builtin(global_invocation_id) id: vec3u) {
    var a = vec4f(f32(id.x)) + vec4f(0.1, 0.2, 0.3, 0.4);
    var b = a + 0.5;
    var c = a + 1.5;
    var d = a + 2.5;
    for (var i = 0u; i < ROUNDS; i++) {
        a = eight(a);
        b = eight(b);
        c = eight(c);
        d = eight(d);
    }
    // Never true, but the compiler cannot know: keeps the computation.
    let sum = a + b + c + d;
    if sum.x < 0.0 {
        result[0] = sum;
    }
}
