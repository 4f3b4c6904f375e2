// Multiplications with additions, and nothing else: what the adapter computes. Sixteen chains that
// do not wait for each other.

@group(0) @binding(0) var<storage, read_write> result: array<vec4f>;

// Rounds of each thread: `src/report/rates.rs` knows what it does.
const ROUNDS: u32 = 32u;

const FACTOR = vec4f(0.999, 0.998, 0.997, 0.996);
const TERM = vec4f(1e-3, 2e-3, 3e-3, 4e-3);

// Eight of a chain: a loop costs more than one of them.
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
    // Never: but the compiler cannot know.
    let sum = a + b + c + d;
    if sum.x < 0.0 {
        result[0] = sum;
    }
}
