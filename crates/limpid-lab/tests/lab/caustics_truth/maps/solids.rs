//! Light on solids: hidden ones, meshes, walls.

use std::sync::Arc;

use limpid::glam::{DVec3, Vec3};
use limpid::mesh::{Mesh, MeshData, Placement};
use limpid::scene::{Scene, Shape, Solid, Surface};
use limpid_lab::reference::Ray;
use limpid_lab::reference::caustics::{Spot, beams, on_solids};
use limpid_lab::reference::optics::fresnel;
use limpid_lab::reference::surroundings::Surroundings;
use limpid_sim::waves::Waves;

use crate::caustics_truth::*;

/// Receivers that are not level: a wall in the water receives light by its cosine, once.
#[test]
fn walls_receive_light_by_their_cosine() {
    let scene = clear(&format!(
        "{FLOOR}[[solid]]\nshape = \"box\"\nmin = [0.4, -1.0, -9.0]\nmax = [0.9, 0.2, 9.0]"
    ));
    let ior = f64::from(scene.liquid.ior);
    let light = sun(OBLIQUE);
    let view = light_view(&light, DVec3::splat(-1.0), DVec3::new(1.0, 0.2, 1.0), &scene, 96);
    let map = beams(&water(Waves::default()), &scene, &light, &view, 1, 2);
    check_accounts(&map);
    let inner = ((1.0 / 3f64.sqrt()) / ior).asin();
    let cos = (2f64 / 3.0).sqrt();
    let below = (1.0 - fresnel(cos, ior)) * cos * POWER;
    let (mut walls, mut floors) = (0, 0);
    for (i, receiver) in map.receivers.iter().enumerate() {
        let Some(spot) = receiver.as_ref().map(|receiver| receiver.spot) else { continue };
        // Where the ray to it entered: inside the frame, and away from its border.
        let from = spot.point.x + spot.point.y * inner.tan();
        let inside = spot.point.z.abs() < 0.9 && from > -0.9;
        if inside && spot.solid == 1 && spot.normal == DVec3::NEG_X && spot.point.y < -0.05 {
            // The lowest part, next to the floor, is skipped.
            if spot.point.y > -0.9 {
                let expected = below * inner.tan();
                assert!(close(map.irradiance[i], expected, 1e-6), "{spot:?}");
                walls += 1;
            }
        }
        if inside && spot.solid == 0 && spot.point.x < -0.15 {
            assert!(close(map.irradiance[i], below, 1e-6), "{spot:?} {}", map.irradiance[i]);
            floors += 1;
        }
        if spot.solid == 1 && spot.normal == DVec3::Y {
            assert_eq!(map.irradiance[i], DVec3::ZERO, "the top is dry");
        }
    }
    assert!(walls > 500 && floors > 200, "{walls} {floors}");
}

/// Light on all solids: behind a wall under water, where refracted light lands but no straight view
/// from the light reaches; on the wall, on a ball, and nowhere else.
#[test]
fn light_reaches_hidden_solids() {
    let scene = clear(&format!(
        "{FLOOR}lit = true\n\
         [[solid]]\nshape = \"box\"\nmin = [-0.3, -1.0, -9.0]\nmax = [-0.2, 0.5, 9.0]\nlit = true\n\
         [[solid]]\nshape = \"sphere\"\ncenter = [1.1, -0.7, 0.3]\nradius = 0.25\nlit = true"
    ));
    let ior = f64::from(scene.liquid.ior);
    let (light, liquid) = (sun(OBLIQUE), water(Waves::default()));
    let bounds = (DVec3::new(-1.5, -1.0, -1.0), DVec3::new(1.5, 0.0, 1.0));
    let maps = on_solids(&liquid, bounds, &scene, &light, 1, 96, 3);
    let at = |solid: usize, point: DVec3, normal: DVec3| {
        let spot = Spot { solid, part: 0, point, normal };
        maps.iter().find(|map| map.takes(&spot)).map_or(DVec3::ZERO, |map| map.at(&spot))
    };
    let cos = (2f64 / 3.0).sqrt();
    let inner = ((1.0 - cos * cos).sqrt() / ior).asin();
    let level = (1.0 - fresnel(cos, ior)) * cos * POWER;
    // Light that just passes the wall's top enters 0.354 from it and continues by 0.482.
    let edge = -0.2 + 0.5 * (1.0 / cos / cos - 1.0).sqrt() + inner.tan();
    let straight = -0.2 + 1.5 * (1.0 / cos / cos - 1.0).sqrt();
    assert!((edge - 0.6355).abs() < 1e-3 && (straight - 0.8607).abs() < 1e-3, "{edge} {straight}");
    for i in 0..40 {
        let x = -0.17 + 0.04 * f64::from(i);
        let found = at(0, DVec3::new(x, -1.0, -0.4), DVec3::Y);
        if x < edge - 0.07 {
            assert_eq!(found, DVec3::ZERO, "{x}");
        } else if x > edge + 0.07 && x < 1.3 {
            assert!(close(found, level, 1e-6), "{x}: {found} {level}");
        }
    }
    // A map along the light does not show the floor within the straight shadow.
    let view = light_view(&light, bounds.0, bounds.1, &scene, 96);
    let map = beams(&liquid, &scene, &light, &view, 1, 3);
    let hidden = Spot { solid: 0, part: 0, point: DVec3::new(0.75, -1.0, -0.4), normal: DVec3::Y };
    assert_eq!(map.at(&hidden), DVec3::ZERO);
    assert!(close(at(0, hidden.point, hidden.normal), level, 1e-6));

    let wall = at(1, DVec3::new(-0.3, -0.5, 0.2), DVec3::NEG_X);
    assert!(close(wall, level * inner.tan(), 1e-6), "{wall}");
    assert_eq!(at(1, DVec3::new(-0.2, -0.5, 0.2), DVec3::X), DVec3::ZERO);
    let towards = DVec3::new(-inner.sin(), inner.cos(), 0.0);
    for normal in [DVec3::Y, towards, DVec3::new(-0.8, 0.5, 0.3).normalize(), DVec3::X, DVec3::Z] {
        let found = at(2, DVec3::new(1.1, -0.7, 0.3) + 0.25 * normal, normal);
        let expected = level / inner.cos() * normal.dot(towards).max(0.0);
        assert!(
            (found - expected).length() < 0.04 * level.length(),
            "{normal}: {found} {expected}"
        );
    }
}

/// Light falls on meshes as on the plane and the box of the same shape, and they shadow alike: as two meshes,
/// and as one, whose level parts lie above each other.
#[test]
fn meshes_receive_and_block_light() {
    let (min, max) = (DVec3::new(-0.3, -1.0, -0.7), DVec3::new(-0.2, -0.4, 0.6));
    let corner =
        |i: u32| DVec3::from([0, 1, 2].map(|k| if i >> k & 1 == 0 { min[k] } else { max[k] }));
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let halves = |[a, b, c, d]: [u32; 4]| [[a, b, c], [a, c, d]];
    let wall = MeshData {
        positions: (0..8).map(corner).collect(),
        triangles: faces.into_iter().flat_map(halves).collect(),
        ..MeshData::default()
    };
    let floor = MeshData {
        positions: [(-3.0, -3.0), (-3.0, 3.0), (3.0, 3.0), (3.0, -3.0)]
            .map(|(x, z)| DVec3::new(x, -1.0, z))
            .to_vec(),
        triangles: halves([0, 1, 2, 3]).to_vec(),
        ..MeshData::default()
    };
    let both = MeshData {
        positions: [floor.positions.clone(), wall.positions.clone()].concat(),
        triangles: (floor.triangles.iter().copied())
            .chain(wall.triangles.iter().map(|triangle| triangle.map(|i| i + 4)))
            .collect(),
        ..MeshData::default()
    };
    let mesh = |data: MeshData| Shape::Mesh {
        mesh: Arc::new(Mesh::new(data).unwrap()),
        placement: Placement::default(),
    };
    let plane = Shape::Plane { origin: -DVec3::Y, normal: Vec3::Y, half_extent: 3.0 };
    let cases =
        [vec![plane, Shape::Box { min, max }], vec![mesh(floor), mesh(wall)], vec![mesh(both)]];
    let (light, liquid) = (sun(OBLIQUE), water(Waves::default()));
    let bounds = (DVec3::new(-1.5, -1.0, -1.0), DVec3::new(1.5, 0.0, 1.0));
    // Points just off the floor, on both sides of the wall and in its shadow, and off the wall. Texels at its
    // foot are left out: they also show the floor below it, which only closed meshes cover.
    let on_floor = (0..60)
        .map(|i| DVec3::new(-0.95 + 0.03 * f64::from(i), -0.9, 0.2))
        .filter(|x| (x.x + 0.25).abs() > 0.12)
        .map(|x| (x, DVec3::NEG_Y));
    let on_wall = (0..9).map(|i| (DVec3::new(-0.4, -0.9 + 0.05 * f64::from(i), 0.1), DVec3::X));
    let on_top = (0..5).map(|i| (DVec3::new(-0.25, -0.3, -0.5 + 0.2 * f64::from(i)), DVec3::NEG_Y));
    let rays: Vec<Ray> = on_floor
        .chain(on_wall)
        .chain(on_top)
        .map(|(origin, direction)| Ray { origin, direction })
        .collect();
    let found = cases.map(|shapes| {
        let solid = |shape| Solid { shape, surface: Surface::Color(Vec3::ONE), lit: true };
        let solids = shapes.into_iter().map(solid).collect();
        let scene = Scene { solids, ..clear("") };
        let maps = on_solids(&liquid, bounds, &scene, &light, 1, 96, 3);
        let surroundings = Surroundings::new(&scene);
        let at = |ray: &Ray| {
            let hit = surroundings.hit(ray).expect("a solid is there");
            let normal = hit.facing(ray.direction);
            let spot = Spot { solid: hit.solid, part: hit.part, point: hit.point, normal };
            maps.iter().find(|map| map.takes(&spot)).map_or(DVec3::ZERO, |map| map.at(&spot))
        };
        let total = maps.iter().map(held).sum::<DVec3>();
        (rays.iter().map(at).collect::<Vec<_>>(), maps.len(), total)
    });
    let [(expected, faces, total), others @ ..] = found;
    let level = expected.iter().copied().fold(DVec3::ZERO, DVec3::max);
    for (found, parts, held) in others {
        assert_eq!(parts, faces);
        assert!(close(held, total, 1e-3), "{held} {total}");
        for ((found, expected), ray) in found.iter().zip(&expected).zip(&rays) {
            // Corners of meshes are in 32 bits.
            assert!(
                (found - expected).length() < 1e-3 * level.length(),
                "{ray:?}: {found} {expected}"
            );
        }
    }
    let dark = expected.iter().filter(|e| e.length() < 0.01 * level.length()).count();
    assert!((3..25).contains(&dark), "the wall shadows {dark} points");
}
