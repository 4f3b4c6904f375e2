//! The comparison of pictures: against NVIDIA's implementation of FLIP, against closed forms, and
//! on planted differences.

use std::fs;

use image::{ImageBuffer, Luma, LumaA, Rgb, RgbImage, Rgba, RgbaImage};
use limpid_io::Error;
use limpid_lab::compare::{FlipMap, PIXELS_PER_DEGREE, compare, compare_files, flip, load_picture};

const BLACK: Rgb<u8> = Rgb([0; 3]);
const WHITE: Rgb<u8> = Rgb([255; 3]);

/// Colour error of green against blue, (203.3017 Hunt-adjusted `HyAB`)^0.7, computed independently.
const MAX_COLOUR_ERROR: f64 = 41.276_098;

fn uniform(width: u32, height: u32, colour: Rgb<u8>) -> RgbImage {
    RgbImage::from_pixel(width, height, colour)
}

/// Uncorrelated bytes: an integer hash of position, channel and seed.
fn noise(width: u32, height: u32, seed: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        Rgb([0, 1, 2].map(|channel| {
            let mut bits = x ^ (y << 11) ^ (channel << 22) ^ (seed << 25);
            for factor in [0x7feb_352d_u32, 0x846c_a68b] {
                bits = (bits ^ (bits >> 16)).wrapping_mul(factor);
            }
            (bits >> 24) as u8
        }))
    })
}

fn checker(width: u32, height: u32, cell: u32, shift: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        if ((x + shift) / cell + y / cell).is_multiple_of(2) { WHITE } else { BLACK }
    })
}

fn gradient(width: u32, height: u32, blue: u8) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        Rgb([(255 * x / width) as u8, (255 * y / height) as u8, blue])
    })
}

/// Mean and greatest absolute deviation of our map from NVIDIA's.
fn deviation(reference: &RgbImage, test: &RgbImage, ours: &FlipMap, ppd: f32) -> (f64, f32) {
    let copy = |picture: &RgbImage| {
        nv_flip::FlipImageRgb8::with_data(picture.width(), picture.height(), picture)
    };
    let theirs = nv_flip::flip(copy(reference), copy(test), ppd).to_vec();
    let their_mean = theirs.iter().map(|&v| f64::from(v)).sum::<f64>() / theirs.len() as f64;
    let worst = ours.values.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    ((ours.mean() - their_mean).abs(), worst)
}

fn assert_agrees(name: &str, reference: &RgbImage, test: &RgbImage, ppd: f32) {
    let ours = flip(reference, test, ppd).unwrap();
    let (mean, worst) = deviation(reference, test, &ours, ppd);
    assert!(
        mean < 1e-3 && worst < 5e-3,
        "{name} at {ppd} pixels per degree: mean deviates by {mean}, a pixel by {worst}"
    );
}

/// The whole pipeline: colour spaces, kernels, borders, both differences, exponents. Odd sizes and
/// pictures smaller than the kernels (10 and 9 pixels each way) test borders.
#[test]
fn agrees_with_nvidias_implementation() {
    let (w, h) = (61, 47);
    let mut lines = uniform(w, h, Rgb([40, 80, 160]));
    for y in 0..h {
        lines.put_pixel(w / 2, y, WHITE);
        lines.put_pixel(y, y, Rgb([255, 30, 0]));
    }
    let edge = |at| {
        let sides = [Rgb([200, 30, 40]), Rgb([20, 180, 90])];
        RgbImage::from_fn(w, h, |x, y| sides[usize::from(x + y / 2 > at)])
    };
    let pairs = [
        ("noise", noise(w, h, 1), noise(w, h, 2)),
        ("gradients", gradient(w, h, 0), gradient(w, h, 255)),
        ("slight gradients", gradient(w, h, 100), gradient(w, h, 103)),
        ("edges", edge(30), edge(33)),
        ("fine checker", checker(w, h, 1, 0), checker(w, h, 1, 1)),
        ("coarse checker", checker(w, h, 5, 0), checker(w, h, 5, 1)),
        ("thin lines", lines, uniform(w, h, Rgb([40, 80, 160]))),
        ("white on black", uniform(w, h, BLACK), uniform(w, h, WHITE)),
        ("green on blue", uniform(w, h, Rgb([0, 0, 255])), uniform(w, h, Rgb([0, 255, 0]))),
        ("a pixel", uniform(1, 1, Rgb([10, 20, 30])), uniform(1, 1, Rgb([200, 0, 90]))),
        ("3x2", noise(3, 2, 3), noise(3, 2, 4)),
        ("a row", noise(33, 1, 3), noise(33, 1, 4)),
        ("a column", noise(1, 33, 3), noise(1, 33, 4)),
    ];
    for (name, reference, test) in &pairs {
        for ppd in [20.0, PIXELS_PER_DEGREE, 110.0] {
            assert_agrees(name, reference, test, ppd);
            assert_agrees(name, test, reference, ppd);
        }
    }
}

/// The bounds of the test above detect maps of another viewing distance, of transposed axes, or
/// with a single wrong pixel.
#[test]
fn agreement_bounds_detect_errors() {
    let (reference, test) = (checker(40, 40, 5, 0), gradient(40, 40, 9));
    let ppd = PIXELS_PER_DEGREE;
    let map = flip(&reference, &test, ppd).unwrap();
    assert!(deviation(&reference, &test, &map, ppd).1 < 5e-3);

    let nearer = flip(&reference, &test, 0.9 * ppd).unwrap();
    assert!(deviation(&reference, &test, &nearer, ppd).1 > 5e-3);

    let mut transposed = map.clone();
    for (index, value) in transposed.values.iter_mut().enumerate() {
        *value = map.values[index % 40 * 40 + index / 40];
    }
    assert!(deviation(&reference, &test, &transposed, ppd).1 > 5e-3);

    let mut spotted = map;
    spotted.values[777] -= 0.01;
    assert!(deviation(&reference, &test, &spotted, ppd).1 > 5e-3);
}

/// Identical pictures differ by exactly zero, without rounding.
#[test]
fn identical_pictures_have_zero_difference() {
    for picture in [noise(37, 23, 5), checker(20, 20, 1, 0), uniform(1, 1, WHITE)] {
        let (comparison, map) = compare(&picture, &picture).unwrap();
        assert!(map.values.iter().all(|&value| value == 0.0));
        assert_eq!((comparison.mean_flip, comparison.p99_flip), (0.0, 0.0));
        assert_eq!((comparison.rmse, comparison.psnr_db), (0.0, None));
        assert_eq!(comparison.max_channel_error, 0);
    }
}

/// The smallest changes score, and larger changes score more.
#[test]
fn small_changes_score() {
    let reference = checker(64, 64, 8, 0);
    let shifted = compare(&reference, &checker(64, 64, 8, 1)).unwrap().0;
    assert!(shifted.mean_flip > 0.05, "{shifted:?}");

    let grey = uniform(64, 64, Rgb([128; 3]));
    let mut faint = grey.clone();
    faint.put_pixel(31, 30, Rgb([128, 129, 128]));
    let mut plain = grey.clone();
    plain.put_pixel(31, 30, WHITE);
    let [faint, plain] = [faint, plain].map(|test| compare(&grey, &test).unwrap().0);
    assert!(faint.mean_flip > 0.0 && faint.max_channel_error == 1, "{faint:?}");
    assert!(plain.worst.flip > 0.1 && plain.worst.flip > 3.0 * faint.worst.flip, "{plain:?}");
}

/// Detail too fine to see at a distance scores far lower than up close, and than a smaller
/// difference over a large area: the purpose of FLIP over per-pixel figures.
#[test]
fn fine_detail_fades_with_distance() {
    let grey = uniform(64, 64, Rgb([188; 3]));
    let fine = checker(64, 64, 1, 0);
    let [near, usual] =
        [20.0, PIXELS_PER_DEGREE].map(|ppd| flip(&grey, &fine, ppd).unwrap().mean());
    let bulk = flip(&grey, &uniform(64, 64, WHITE), PIXELS_PER_DEGREE).unwrap().mean();
    assert!(usual < 0.1 * near && usual < 0.1 * bulk, "{near} {usual} {bulk}");
}

/// Colour difference and redistribution against closed forms: uniform greys have no features and no
/// chroma, so FLIP depends on their difference of L* only.
#[test]
fn uniform_greys_match_the_closed_form() {
    let lightness = |level: u8| {
        let value = f64::from(level) / 255.0;
        let y = if value <= 0.040_45 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) };
        if y > 216.0 / 24389.0 { 116.0 * y.cbrt() - 16.0 } else { y * 24389.0 / 27.0 }
    };
    let expected = |a, b| {
        let error = f64::powf(lightness(a) - lightness(b), 0.7).abs() / MAX_COLOUR_ERROR;
        if error < 0.4 { 0.95 * error / 0.4 } else { 0.95 + 0.05 * (error - 0.4) / 0.6 }
    };
    for (light, dark) in [(255, 0), (128, 127), (3, 0), (200, 90)] {
        let (reference, test) = (uniform(13, 9, Rgb([light; 3])), uniform(13, 9, Rgb([dark; 3])));
        let there = flip(&reference, &test, PIXELS_PER_DEGREE).unwrap();
        let back = flip(&test, &reference, PIXELS_PER_DEGREE).unwrap();
        assert_eq!(there, back, "swapping the pictures changes nothing");
        for &value in &there.values {
            let error = (f64::from(value) - expected(light, dark)).abs();
            assert!(error < 1e-4, "{light} and {dark}: {value}, not {}", expected(light, dark));
        }
    }
    // White on black: 25.12, beyond the knee at 16.51 of 41.28.
    assert!((expected(255, 0) - 0.967_38).abs() < 1e-5);
}

/// RMSE and PSNR: a difference of 1 everywhere is 1/255, and 20 log₁₀ 255 = 48.13 dB; a difference
/// of 51 in one channel of three is √(1/3)/5.
#[test]
fn rmse_and_psnr_match_the_closed_form() {
    let reference = noise(40, 30, 6);
    let moved = |by: [u8; 3]| {
        let mut test = reference.clone();
        for pixel in test.pixels_mut() {
            for (level, by) in pixel.0.iter_mut().zip(by) {
                *level = if *level > 127 { *level - by } else { *level + by };
            }
        }
        compare(&reference, &test).unwrap().0
    };
    let one = moved([1; 3]);
    assert_eq!((one.rmse, one.max_channel_error), (1.0 / 255.0, 1));
    assert!((one.psnr_db.unwrap() - 48.130_803_6).abs() < 1e-6);

    let red = moved([51, 0, 0]);
    assert!((red.rmse - (1.0_f64 / 3.0).sqrt() / 5.0).abs() < 1e-12);
    assert_eq!(red.max_channel_error, 51);
}

/// The worst pixel: column and row in order, the colours of the right picture, the first of equals.
#[test]
fn worst_pixel_is_located() {
    let reference = uniform(50, 40, Rgb([60, 70, 80]));
    for place in [(37, 8), (0, 0), (49, 39), (0, 39)] {
        let mut test = reference.clone();
        test.put_pixel(place.0, place.1, Rgb([250, 240, 10]));
        let worst = compare(&reference, &test).unwrap().0.worst;
        assert_eq!((worst.x, worst.y), place);
        assert_eq!((worst.reference, worst.test), ([60, 70, 80], [250, 240, 10]));
        assert!(worst.flip > 0.1);
    }
    let everywhere = FlipMap { width: 3, height: 2, values: vec![0.1, 0.4, 0.4, 0.2, 0.4, 0.0] };
    assert_eq!(everywhere.worst(), (1, 0, 0.4));
}

/// Statistics of a known map, including the extremes and an empty mask.
#[test]
fn statistics_of_a_known_map() {
    let values = (1..=200).rev().map(|i| i as f32 / 256.0).collect();
    let map = FlipMap { width: 20, height: 10, values };
    assert_eq!(map.mean(), 100.5 / 256.0);
    let rank = |fraction| map.percentile(fraction) * 256.0;
    assert_eq!([0.0, 0.5, 0.99, 1.0].map(rank), [1.0, 100.0, 198.0, 200.0]);

    assert_eq!(map.mean_where(|_, _| true), Some(map.mean()));
    assert_eq!(map.mean_where(|x, y| (x, y) == (3, 2)), Some(157.0 / 256.0));
    assert_eq!(map.mean_where(|x, _| x > 19), None);
}

/// The number of threads changes no bit of the map or of its mean.
#[test]
fn results_do_not_depend_on_threads() {
    let (reference, test) = (noise(97, 83, 7), noise(97, 83, 8));
    let results = [1, 2, 7].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let (comparison, map) = pool.install(|| compare(&reference, &test)).unwrap();
        let bits: Vec<u32> = map.values.iter().map(|value| value.to_bits()).collect();
        (bits, comparison.mean_flip.to_bits(), comparison.rmse.to_bits())
    });
    assert!(results.iter().all(|result| *result == results[0]));
}

/// Values stay in range for opposite extremes with strong features, from the nearest and the
/// farthest viewing distance.
#[test]
fn values_stay_between_0_and_1() {
    let pairs = [
        (checker(30, 30, 4, 0), uniform(30, 30, BLACK)),
        (noise(30, 30, 9), uniform(30, 30, Rgb([0, 0, 255]))),
        (uniform(30, 30, Rgb([0, 255, 0])), checker(30, 30, 30, 0)),
    ];
    for (reference, test) in &pairs {
        for ppd in [1.0, 2.0, PIXELS_PER_DEGREE, 1000.0] {
            let map = flip(reference, test, ppd).unwrap();
            assert!(map.values.iter().all(|value| (0.0..=1.0).contains(value)), "at {ppd}");
        }
    }
}

/// The difference picture has the right size and orientation, and approximates the original magma.
#[test]
fn the_difference_picture_is_magma() {
    let values: Vec<f32> = (0..=255).map(|i| i as f32 / 255.0).collect();
    let ours = FlipMap { width: 128, height: 2, values }.picture();
    assert_eq!(ours.dimensions(), (128, 2));
    let theirs = nv_flip::magma_lut().to_vec();
    let worst = ours.iter().zip(&theirs).map(|(&a, &b)| a.abs_diff(b)).max();
    assert!(worst <= Some(6), "{worst:?} of 255");
}

/// Loading: 16 bits round to the nearest, grey expands to RGB, an opaque alpha is dropped and a
/// transparent pixel is rejected with its position and the remedy.
#[test]
fn pictures_load_as_8_bit_rgb() {
    let folder = tempfile::tempdir().unwrap();
    let deep = folder.path().join("deep.png");
    let levels = [0_u16, 128, 129, 25_700 + 128, 25_700 + 129, 65_535];
    let picture = ImageBuffer::<Rgb<u16>, _>::from_raw(2, 1, levels.to_vec()).unwrap();
    picture.save(&deep).unwrap();
    assert_eq!(load_picture(&deep).unwrap().into_raw(), [0, 0, 1, 100, 101, 255]);

    let grey = folder.path().join("grey.png");
    ImageBuffer::<Luma<u8>, _>::from_pixel(2, 3, Luma([77])).save(&grey).unwrap();
    assert_eq!(load_picture(&grey).unwrap(), uniform(2, 3, Rgb([77; 3])));

    let opaque = folder.path().join("opaque.png");
    ImageBuffer::<LumaA<u8>, _>::from_pixel(2, 3, LumaA([9, 255])).save(&opaque).unwrap();
    assert_eq!(load_picture(&opaque).unwrap(), uniform(2, 3, Rgb([9; 3])));

    let glass = folder.path().join("glass.png");
    let mut picture = RgbaImage::from_pixel(4, 4, Rgba([1, 2, 3, 255]));
    picture.put_pixel(3, 1, Rgba([1, 2, 3, 254]));
    picture.save(&glass).unwrap();
    let error = load_picture(&glass).unwrap_err();
    assert!(matches!(error, Error::Format { .. }));
    assert!(error.to_string().contains("glass.png: transparent at pixel (3, 1)"), "{error}");
    assert!(error.to_string().contains("flatten"), "{error}");
}

/// Errors of unusable files name the file and the cause.
#[test]
fn errors_name_unusable_files() {
    let folder = tempfile::tempdir().unwrap();
    let good = folder.path().join("good.png");
    noise(64, 64, 10).save(&good).unwrap();

    let missing = folder.path().join("missing.png");
    let error = compare_files(&good, &missing).unwrap_err();
    assert!(matches!(error, Error::Io { .. }));
    assert!(error.to_string().contains("missing.png: cannot read"), "{error}");

    let text = folder.path().join("text.png");
    fs::write(&text, "no picture").unwrap();
    let error = compare_files(&text, &good).unwrap_err();
    assert!(matches!(error, Error::Format { .. }));
    assert!(error.to_string().contains("text.png: not a PNG"), "{error}");

    let cut = folder.path().join("cut.png");
    let bytes = fs::read(&good).unwrap();
    fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let error = compare_files(&good, &cut).unwrap_err();
    assert!(matches!(error, Error::Malformed { .. }));
    assert!(error.to_string().contains("cut.png: byte "), "{error}");

    let wide = folder.path().join("wide.png");
    noise(65, 64, 10).save(&wide).unwrap();
    let message = compare_files(&good, &wide).unwrap_err().to_string();
    for part in ["good.png", "wide.png", "64x64", "65x64"] {
        assert!(message.contains(part), "{part} is not in: {message}");
    }
}

/// Comparisons without an answer are rejected: different sizes, no pixels, an impossible distance.
#[test]
fn impossible_comparisons_are_rejected() {
    let error = compare(&uniform(8, 6, BLACK), &uniform(6, 8, BLACK)).unwrap_err();
    assert!(matches!(error, Error::Mismatch(_)));
    assert!(error.to_string().contains("8x6") && error.to_string().contains("6x8"), "{error}");

    for (width, height) in [(0, 0), (0, 4), (4, 0)] {
        let nothing = RgbImage::new(width, height);
        assert!(matches!(compare(&nothing, &nothing), Err(Error::Usage(_))));
    }
    let picture = uniform(4, 4, BLACK);
    for ppd in [0.0, -67.0, 1e6, f32::NAN, f32::INFINITY] {
        assert!(matches!(flip(&picture, &picture, ppd), Err(Error::Usage(_))), "{ppd}");
    }
}

/// The JSON report has the documented keys, and null for an infinite PSNR.
#[test]
fn json_report_keys() {
    let picture = uniform(2, 2, Rgb([1, 2, 3]));
    let json = serde_json::to_value(compare(&picture, &picture).unwrap().0).unwrap();
    let expected = serde_json::json!({
        "mean_flip": 0.0, "p99_flip": 0.0, "rmse": 0.0, "psnr_db": null,
        "worst": { "x": 0, "y": 0, "flip": 0.0, "reference": [1, 2, 3], "test": [1, 2, 3] },
        "max_channel_error": 0,
    });
    assert_eq!(json, expected);
}
