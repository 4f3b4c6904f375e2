//! The truth over a light's layers, in the device's format.

use limpid::glam::{DVec2, DVec3, Vec3};
use limpid::light_view::LightView;
use limpid::scene::{Light, Scene};
use limpid_lab::reference::analytic::{Ball, Block};
use limpid_lab::reference::caustics::{beams, beams_over_layers};
use limpid_lab::reference::layers::{Layer, Pair};
use limpid_lab::reference::surroundings::Surroundings;
use limpid_lab::reference::{Crossing, Liquid, Ray};

use crate::caustics_truth::*;

/// A layer in the device's format, from the point and the normal hit by each ray of the light's
/// view.
fn layer(view: &LightView, hit: impl Fn(&Ray) -> Option<(DVec3, DVec3)>) -> Layer {
    let texels: Vec<[f32; 4]> = (0..view.size.element_product())
        .map(|i| {
            let u = DVec2::new((i % view.size.x).into(), (i / view.size.x).into()) + 0.5;
            let (origin, direction) = view.ray(u);
            let Some((point, normal)) = hit(&Ray { origin, direction }) else { return [0.0; 4] };
            let x = view.view_from_world * (point - view.origin);
            let n = view.view_from_world * normal;
            let plane = if view.orthographic {
                let slope = n.truncate() / -n.z;
                slope.extend(slope.dot(x.truncate()) - (view.far + x.z))
            } else {
                n / n.dot(x)
            };
            [plane.x as f32, plane.y as f32, plane.z as f32, -x.z as f32]
        })
        .collect();
    Layer::new(view.size, &texels)
}

/// The light's layers of a liquid over solids: front, back and solids.
fn layers(liquid: &impl Liquid, scene: &Scene, view: &LightView) -> (Pair, Layer) {
    let surroundings = Surroundings::new(scene);
    let enter = |ray: &Ray| liquid.crossing(ray, false);
    let front = layer(view, |ray| enter(ray).map(|c| (ray.at(c.t), c.normal)));
    let back = layer(view, |ray| {
        let inner = Ray { origin: ray.at(enter(ray)?.t), ..*ray };
        liquid.crossing(&inner, true).map(|c| (inner.at(c.t), c.normal))
    });
    let solids = layer(view, |ray| surroundings.hit(ray).map(|h| (h.point, h.normal)));
    ([front, back], solids)
}

/// The truth over layers equals that of the liquid itself if the layers, in the device's format,
/// are planes: from a sun and from a point light, through one interface and two.
#[test]
fn planar_layers_give_the_same_map() {
    let scene = scene(&format!("[liquid]\nior = 1.33\nabsorption = [0.8, 0.3, 0.1]\n{FLOOR}"));
    let plate = Block { min: DVec3::new(-90.0, -0.5, -90.0), max: DVec3::new(90.0, 0.0, 90.0) };
    let full = Block { min: DVec3::new(-90.0, -1.0, -90.0), ..plate };
    let point = Light::Point { position: DVec3::new(1.0, 4.0, 0.5), intensity: Vec3::splat(9.0) };
    for light in [sun(OBLIQUE), sun(DVec3::NEG_Y), point] {
        let view = light_view(&light, -DVec3::ONE, DVec3::new(1.0, 0.0, 1.0), &scene, 32);
        for (liquid, interfaces, contact) in [(plate, 2, 0.0), (full, 1, 0.01), (plate, 1, 0.6)] {
            let (pair, solids) = layers(&liquid, &scene, &view);
            let classes = [&pair];
            let over = |interfaces| {
                let known = (&classes[..], &solids);
                beams_over_layers(&view, known, &light, &scene.liquid, contact, interfaces, 2)
            };
            let found = over(interfaces);
            check_accounts(&found);
            // A plate that touches the floor by the `contact` tolerance counts as water down to the
            // floor.
            let same = if contact > 0.5 { full } else { liquid };
            let exact = beams(&same, &scene, &light, &view, interfaces, 2);
            assert!(exact.flux.received.y > 0.5 * exact.flux.transmitted.y, "{:?}", exact.flux);
            let received = (found.flux.received, exact.flux.received);
            assert!(close(received.0, received.1, 5e-2), "{received:?}");
            // Layers lose light that lands outside the frame, and with it a border.
            let size = view.size;
            let border = 2;
            for y in border..size.y - border {
                for x in border..size.x - border {
                    let i = texel(&exact, x, y);
                    let (a, b) = (found.irradiance[i], exact.irradiance[i]);
                    let whole = b.y > 0.99 * exact.irradiance[texel(&exact, x, y - 1)].y
                        && b.y > 0.99 * exact.irradiance[texel(&exact, x, y + 1)].y;
                    if whole {
                        assert!(close(a, b, 1e-3), "{light:?} {interfaces} {x} {y}: {a} {b}");
                    }
                }
            }
        }
    }
}

/// The truth over layers of curved surfaces: finer layers of waves and of a ball converge to the
/// maps of the liquids themselves.
#[test]
fn finer_layers_converge() {
    let errors = |liquid: Box<dyn Liquid>, floor: &str, interfaces: u32| {
        let scene = clear(&FLOOR.replace("-1.0", floor));
        struct Borrowed<'a>(&'a dyn Liquid);
        impl Liquid for Borrowed<'_> {
            fn crossing(&self, ray: &Ray, inside: bool) -> Option<Crossing> {
                self.0.crossing(ray, inside)
            }
            fn contains(&self, point: DVec3) -> bool {
                self.0.contains(point)
            }
        }
        [24, 96].map(|size| {
            let view = overhead(1.2, size);
            let (pair, solids) = layers(&Borrowed(&*liquid), &scene, &view);
            let light = sun(DVec3::NEG_Y);
            let known = (&[&pair][..], &solids);
            let over =
                beams_over_layers(&view, known, &light, &scene.liquid, 0.0, interfaces, 96 / size);
            let exact = beams(&*liquid, &scene, &light, &view, interfaces, 96 / size);
            over.relative_l1(&exact)
        })
    };
    let wavy = errors(Box::new(water(waves(0.08))), "-2.0", 1);
    let ball = errors(Box::new(Ball { center: DVec3::ZERO, radius: 1.0 }), "-1.3", 2);
    println!("waves {wavy:?}, ball {ball:?}");
    assert!(wavy[1] < 0.7 * wavy[0], "{wavy:?}");
    assert!(ball[1] < 0.7 * ball[0], "{ball:?}");
}
