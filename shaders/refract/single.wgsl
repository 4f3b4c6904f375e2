// `single`: one lookup, offset by the surface normal.

#import refract/one_layer.wgsl

fn intersect(layer_class: i32, side: i32, ray: ScreenRay) -> Interface {
    return single(layer_class, side, ray);
}
