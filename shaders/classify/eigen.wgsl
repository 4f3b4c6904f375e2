// Eigenvalues and eigenvectors of a symmetric matrix by cyclic Jacobi rotations, which stay exact for
// coincident eigenvalues, the common case in liquid.

// A symmetric matrix.
struct Symmetric {
    diagonal: vec3f,
    off_diagonal: vec3f, // xy, xz, yz
}

// Eigenvalues, unsorted, and orthonormal eigenvectors in the same order.
struct Eigen {
    values: vec3f,
    vectors: mat3x3f,
}

// Six sweeps over the three off-diagonal entries: convergence is quadratic.
const ROTATIONS: u32 = 18u;

// Off-diagonal entries below this share of the trace are 0 in 32-bit floats.
const NEGLIGIBLE: f32 = 1e-9;

fn eigen(matrix: Symmetric) -> Eigen {
    var d = matrix.diagonal;
    var off = matrix.off_diagonal;
    var u = vec3f(1.0, 0.0, 0.0);
    var v = vec3f(0.0, 1.0, 0.0);
    var w = vec3f(0.0, 0.0, 1.0);
    let scale = NEGLIGIBLE * (abs(d.x) + abs(d.y) + abs(d.z));
    for (var i = 0u; i < ROTATIONS; i++) {
        if abs(off.x) + abs(off.y) + abs(off.z) <= scale {
            break;
        }
        if abs(off.x) > scale {
            // Tangent of the smaller of the two angles that annihilate xy.
            let cotangent = (d.y - d.x) / (2.0 * off.x);
            let size = 1.0 / (abs(cotangent) + sqrt(cotangent * cotangent + 1.0));
            let t = select(size, -size, cotangent < 0.0);
            let c = 1.0 / sqrt(t * t + 1.0);
            let s = t * c;
            d = vec3f(d.x - t * off.x, d.y + t * off.x, d.z);
            off = vec3f(0.0, c * off.y - s * off.z, s * off.y + c * off.z);
            let turned = c * u - s * v;
            v = s * u + c * v;
            u = turned;
        }
        // Rotates the axes: y, z and x become x, y and z.
        d = d.yzx;
        off = off.zxy;
        let first = u;
        u = v;
        v = w;
        w = first;
    }
    return Eigen(d, mat3x3f(u, v, w));
}

// Matrix with these eigenvalues and orthonormal eigenvectors.
fn compose(values: vec3f, vectors: mat3x3f) -> Symmetric {
    let u = vectors[0];
    let v = vectors[1];
    let w = vectors[2];
    return Symmetric(
        values.x * u * u + values.y * v * v + values.z * w * w,
        values.x * u.xxy * u.yzz + values.y * v.xxy * v.yzz + values.z * w.xxy * w.yzz,
    );
}
