// Null intersector, which measures the overhead of the benchmark.

#import refract/interfaces.wgsl
#import refract/pixels.wgsl

fn liquid_exit(ray: ScreenRay, texel: vec2i) -> Interface {
    return interface_at(ray, 0.5, vec3f(0.0, 0.0, -1.0), texel);
}

fn front_entry(layer_class: i32, ray: ScreenRay) -> Interface {
    return interface_at(ray, 0.5, vec3f(0.0, 0.0, -1.0), vec2i(0));
}

fn opaque_entry(ray: ScreenRay) -> Interface {
    return front_entry(OPAQUE, ray);
}
