// The grain of software adapters: a thread draws a column of eight pixels, four to a vector, because starting a
// workgroup takes as long as some thousand operations.

alias Real = vec4f;
alias Index = vec4u;
alias Truth = vec4<bool>;

// As in splat/pixel.wgsl.
const ROWS: u32 = 8u;
const PARTS: u32 = 2u;
const STAGED: bool = false;

fn rows_below(u: vec2f) -> Real {
    return vec4f(
        camera_omega(u).y,
        camera_omega(u + vec2f(0.0, 1.0)).y,
        camera_omega(u + vec2f(0.0, 2.0)).y,
        camera_omega(u + vec2f(0.0, 3.0)).y,
    );
}

fn real_at(value: Real, row: u32) -> f32 {
    return value[row];
}

fn index_at(value: Index, row: u32) -> u32 {
    return value[row];
}

fn truth_at(value: Truth, row: u32) -> bool {
    return value[row];
}

fn each_real(a: f32, b: f32, c: f32, d: f32) -> Real {
    return vec4f(a, b, c, d);
}
