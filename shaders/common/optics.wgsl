// Refraction, reflectance and absorption. Directions are unit vectors; `n` is the unit normal on the
// incident side, so cos_theta_i = -dot(d, n) >= 0; eta = n_transmitted / n_incident.

// Cosine of the transmitted angle by Snell's law; negative for total internal reflection.
fn optics_cos_transmitted(cos_theta_i: f32, eta: f32) -> f32 {
    let sin2_theta_t = (1.0 - cos_theta_i * cos_theta_i) / (eta * eta);
    return select(sqrt(max(1.0 - sin2_theta_t, 0.0)), -1.0, sin2_theta_t > 1.0);
}

// Refracted direction, given the (non-negative) transmitted cosine.
fn optics_refract(d: vec3f, n: vec3f, cos_theta_i: f32, cos_theta_t: f32, eta: f32) -> vec3f {
    return normalize(d / eta + (cos_theta_i / eta - cos_theta_t) * n);
}

// Unpolarised reflectance of a dielectric; 1 for total internal reflection (cos_theta_t < 0).
fn optics_fresnel(cos_theta_i: f32, cos_theta_t: f32, eta: f32) -> f32 {
    if cos_theta_t < 0.0 {
        return 1.0;
    }
    // Avoids 0/0 for grazing light between equal media, where nothing is reflected.
    let r_parl = (eta * cos_theta_i - cos_theta_t) / max(eta * cos_theta_i + cos_theta_t, 1e-20);
    let r_perp = (cos_theta_i - eta * cos_theta_t) / max(cos_theta_i + eta * cos_theta_t, 1e-20);
    // A quotient of equal numbers may round to more than 1.
    return min(0.5 * (r_parl * r_parl + r_perp * r_perp), 1.0);
}

// Schlick's approximation (1994). From the denser side it uses the transmitted cosine, to reproduce
// the critical angle.
fn optics_schlick(cos_theta_i: f32, cos_theta_t: f32, eta: f32) -> f32 {
    if cos_theta_t < 0.0 {
        return 1.0;
    }
    let r0 = (eta - 1.0) / (eta + 1.0);
    let c = 1.0 - select(cos_theta_t, cos_theta_i, eta > 1.0);
    let c2 = c * c;
    return min(r0 * r0 + (1.0 - r0 * r0) * c2 * c2 * c, 1.0);
}

// Transmittance over `length` metres with `absorption` in 1/m (Beer and Lambert).
fn optics_transmittance(absorption: vec3f, length: f32) -> vec3f {
    return exp(-absorption * length);
}
