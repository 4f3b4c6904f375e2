// Eigenvalues and eigenvectors of a symmetric matrix: cyclic Jacobi rotations, which stay exact
// where eigenvalues coincide, and in liquid nearly all of them do.

// A symmetric matrix.
struct Symmetric {
    diagonal: vec3f,
    off_diagonal: vec3f, // xy, xz, yz
}

// The vectors are orthonormal; in no order, as the values.
struct Eigen {
    values: vec3f,
    vectors: mat3x3f,
}

// Six sweeps over the three entries beside the diagonal: convergence is quadratic.
const ROTATIONS: u32 = 18u;

// Of the trace: an entry below that is 0 to 32-bit floats.
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
            // The smaller of the two angles that make xy vanish, as its tangent.
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
        // y, z and x are the next x, y and z.
        d = d.yzx;
        off = off.zxy;
        let first = u;
        u = v;
        v = w;
        w = first;
    }
    return Eigen(d, mat3x3f(u, v, w));
}

// The matrix of these eigenvalues and orthonormal eigenvectors.
fn compose(values: vec3f, vectors: mat3x3f) -> Symmetric {
    let u = vectors[0];
    let v = vectors[1];
    let w = vectors[2];
    return Symmetric(
        values.x * u * u + values.y * v * v + values.z * w * w,
        values.x * u.xxy * u.yzz + values.y * v.xxy * v.yzz + values.z * w.xxy * w.yzz,
    );
}
