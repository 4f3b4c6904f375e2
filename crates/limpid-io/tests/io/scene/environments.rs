//! Environment map files: formats, damage, mean radiance, and refused radiances.

use std::fs;

use glam::{UVec2, Vec3};
use image::{DynamicImage, Rgb, Rgb32FImage, RgbImage};
use limpid::environment::Environment;
use limpid_io::project::Project;

fn close(a: Vec3, b: Vec3, tolerance: f32) -> bool {
    (a - b).abs().max_element() <= tolerance
}

fn radiance(x: u32, y: u32) -> [f32; 3] {
    [0.25 * (x + 1) as f32, 0.5 * (y + 1) as f32, 3.0]
}

/// Each file format preserves the values and the orientation of an environment map.
#[test]
fn environment_file_formats() {
    let folder = tempfile::tempdir().unwrap();
    let map = Rgb32FImage::from_fn(4, 2, |x, y| Rgb(radiance(x, y)));
    for (name, tolerance) in [("sky.exr", 0.0), ("sky.hdr", 3.0 / 128.0)] {
        let path = folder.path().join(name);
        DynamicImage::ImageRgb32F(map.clone()).save(&path).unwrap();
        let Environment::Map { size, pixels } = limpid_io::environment::load(&path).unwrap() else {
            panic!()
        };
        assert_eq!(size, UVec2::new(4, 2));
        for (i, pixel) in (0..).zip(pixels.iter()) {
            let [r, g, b, one] = *pixel;
            let expected = Vec3::from_array(radiance(i % 4, i / 4));
            let found = Vec3::new(r, g, b);
            assert!(close(found, expected, tolerance), "{name}: {found}, not {expected}");
            assert_eq!(one, 1.0);
        }
    }
    // PNG is sRGB: 188 is half the radiance of white.
    let path = folder.path().join("sky.png");
    RgbImage::from_pixel(1, 1, Rgb([188, 0, 255])).save(&path).unwrap();
    let Environment::Map { pixels, .. } = limpid_io::environment::load(&path).unwrap() else {
        panic!()
    };
    assert!((pixels[0][0] - 0.5029).abs() < 1e-4, "{pixels:?}");
    assert_eq!(pixels[0][1..], [0.0, 1.0, 1.0]);
    // The format is that of the contents, not of the name.
    fs::rename(&path, folder.path().join("png.hdr")).unwrap();
    let renamed = limpid_io::environment::load(&folder.path().join("png.hdr")).unwrap();
    assert_eq!(renamed, Environment::Map { size: UVec2::ONE, pixels });
}

/// Files that are not pictures, or incomplete ones, are errors that name the file, never panics.
#[test]
fn damaged_environment_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let code = |name: &str| {
        let error = limpid_io::environment::load(&path(name)).expect_err(name);
        let message = error.to_string();
        assert!(message.contains(name) && !message.contains('\n'), "{message}");
        error.category() as u8
    };
    assert_eq!(code("none.hdr"), 4);
    fs::create_dir(path("folder.exr")).unwrap();
    assert_eq!(code("folder.exr"), 4);
    for name in ["text.txt", "text.hdr", "text.exr", "text.png", "empty.hdr", "empty.png"] {
        fs::write(path(name), if name.starts_with("text") { "no picture at all" } else { "" })
            .unwrap();
        assert!([3, 4].contains(&code(name)), "{name}");
    }
    let map = Rgb32FImage::from_fn(64, 32, |x, y| Rgb(radiance(x, y)));
    for name in ["cut.hdr", "cut.exr", "cut.png"] {
        let picture = DynamicImage::ImageRgb32F(map.clone());
        let picture = if name.ends_with("png") { picture.into_rgb8().into() } else { picture };
        picture.save(path(name)).unwrap();
        let whole = fs::read(path(name)).unwrap();
        for share in [1, 4, 7] {
            fs::write(path(name), &whole[..whole.len() * share / 8]).unwrap();
            assert!([3, 4].contains(&code(name)), "{name}");
        }
    }
    for (name, value) in [("nan.exr", f32::NAN), ("infinite.exr", f32::INFINITY)] {
        let map = Rgb32FImage::from_pixel(2, 1, Rgb([0.0, value, 0.0]));
        DynamicImage::ImageRgb32F(map).save(path(name)).unwrap();
        assert_eq!(code(name), 3);
    }
}

/// The mean over solid angle agrees with a quadrature and with closed forms.
#[test]
fn mean_of_an_environment() {
    let [zenith, horizon, nadir] = [Vec3::X, Vec3::new(0.5, 2.0, 0.0), Vec3::new(0.0, 1.0, 4.0)];
    let gradient = Environment::Gradient { zenith, horizon, nadir };
    // Uniform in solid angle is uniform in the sine of the elevation.
    let count = 1000;
    let sines = (0..count).map(|i| (2 * i + 1 - count) as f32 / count as f32);
    let at = |sine: f32| horizon.lerp(if sine > 0.0 { zenith } else { nadir }, sine.abs());
    let mean = sines.map(at).sum::<Vec3>() / count as f32;
    assert!(close(gradient.mean(), mean, 1e-3), "{} {mean}", gradient.mean());

    let map = |height: u32, color: &dyn Fn(u32) -> Vec3| {
        let pixels = (0..height)
            .flat_map(|row| {
                let c = color(row);
                [[c.x, c.y, c.z, 1.0]; 3]
            })
            .collect();
        Environment::Map { size: UVec2::new(3, height), pixels }
    };
    let even = map(7, &|_| Vec3::new(1.0, 2.0, 3.0));
    assert!(close(even.mean(), Vec3::new(1.0, 2.0, 3.0), 1e-6));
    let half = map(8, &|row| if row < 4 { Vec3::ONE } else { Vec3::ZERO });
    assert!(close(half.mean(), Vec3::splat(0.5), 1e-6));
    // A cap of 18° around the zenith is (1 − cos 18°) / 2 of the sphere.
    let cap = map(1000, &|row| if row < 100 { Vec3::ONE } else { Vec3::ZERO });
    let share = 0.5 * (1.0 - 18f32.to_radians().cos());
    assert!(close(cap.mean(), Vec3::splat(share), 1e-5), "{} {share}", cap.mean());
    assert!(close(cap.scaled(3.0).mean(), Vec3::splat(3.0 * share), 3e-5));
}

/// Negative and excessive radiances are errors that name the key.
#[test]
fn radiances_out_of_range_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    for value in [-0.5f32, 1e38] {
        let color = format!("[1.0, {value:?}, 1.0]");
        for (key, text) in [
            ("environment", format!("[environment]\nradiance = {color}")),
            (
                "environment",
                format!("[environment]\ngradient = {{ zenith = {color}, horizon = [1, 1, 1] }}"),
            ),
            ("color", format!("[[solid]]\nshape = \"plane\"\norigin = [0, 0, 0]\ncolor = {color}")),
            (
                "irradiance",
                format!("[[light]]\nsun = {{ direction = [0, -1, 0], irradiance = {color} }}"),
            ),
        ] {
            let text = format!("[liquid]\nior = 1.33\n{text}\n");
            let scene = Project::parse(&text, "s.toml", folder.path());
            let error = scene.and_then(|scene| scene.check()).expect_err(&text).to_string();
            assert!(error.contains(key) && error.contains("0 to 1e12"), "{error}");
        }
        let path = folder.path().join("sky.exr");
        let map = Rgb32FImage::from_pixel(2, 1, Rgb([1.0, value, 1.0]));
        DynamicImage::ImageRgb32F(map).save(&path).unwrap();
        let error = limpid_io::environment::load(&path).unwrap_err().to_string();
        assert!(error.contains("0 to 1e12"), "{error}");
    }
}
