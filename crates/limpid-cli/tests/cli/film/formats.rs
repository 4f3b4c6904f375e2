//! Contents of films in each format.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use glam::UVec2;
use image::{Rgb, RgbImage};
use limpid_io::Error;
use limpid_io::film::{Film, FilmFormat};

use super::{
    SIZE, decode, difference, ffmpeg, file_url, folder, names, processes, read_apng, read_gif,
};

/// A picture of few colours: a bar that moves with every frame.
fn few_colors(frame: u32) -> RgbImage {
    RgbImage::from_fn(SIZE.x, SIZE.y, |x, y| match (x / 8 + 20 - frame) % 20 {
        0 => Rgb([250, 20, 90]),
        _ => Rgb([40, (y / 8 * 16) as u8, 200]),
    })
}

/// A picture of more colours than a GIF can have.
fn many_colors(frame: u32) -> RgbImage {
    let part = |x: u32, size: u32| (x * 255 / size) as u8;
    RgbImage::from_fn(SIZE.x, SIZE.y, |x, y| {
        Rgb([part(x, SIZE.x), part(y, SIZE.y), 30 * frame as u8])
    })
}

/// Writes a film of these pictures, which must be the only file in its folder.
fn write(path: &Path, fps: f64, pictures: &[RgbImage]) {
    let mut film = Film::create(path, SIZE, fps).expect("the film begins");
    for picture in pictures {
        film.push(picture).expect("the picture is added");
    }
    film.finish().expect("the film ends");
    let folder = path.parent().unwrap();
    assert_eq!(names(folder), [path.file_name().unwrap().to_str().unwrap().into()].into());
}

/// An APNG preserves its pictures bit-exactly, and has the right number of frames, known only at the
/// end, and the right delays.
#[test]
fn an_apng_is_lossless_and_exactly_timed() {
    let folder = folder();
    let path = folder.path().join("film.apng");
    for (fps, delay) in [(30.0, (1, 30)), (29.97, (100, 2997)), (0.5, (2, 1)), (1000.0, (1, 1000))]
    {
        for count in [1, 5] {
            let pictures: Vec<_> = (0..count).map(many_colors).collect();
            write(&path, fps, &pictures);
            assert_eq!(read_apng(&path), pictures);
            // Refused as a picture, which would be its first frame.
            let error = limpid_lab::compare::load_picture(&path).unwrap_err().to_string();
            assert!(error.contains("film"), "{error}");

            let mut options = png::DecodeOptions::default();
            options.set_skip_ancillary_crc_failures(false);
            let file = std::io::BufReader::new(fs::File::open(&path).unwrap());
            let mut reader = png::Decoder::new_with_options(file, options).read_info().unwrap();
            let control = *reader.info().animation_control().expect("an animation");
            assert_eq!((control.num_frames, control.num_plays), (count, 0));
            for _ in 0..count {
                reader.next_frame(&mut vec![0; reader.output_buffer_size().unwrap()]).unwrap();
                let control = reader.info().frame_control().expect("a frame");
                assert_eq!((control.delay_num, control.delay_den), delay, "{fps} per second");
            }
        }
    }
}

/// A GIF of few colours preserves its pictures bit-exactly, and repeats for ever.
#[test]
fn a_gif_of_few_colors_is_lossless() {
    let folder = folder();
    let path = folder.path().join("film.gif");
    let pictures: Vec<_> = (0..6).map(few_colors).collect();
    write(&path, 25.0, &pictures);
    let (read, delays, repeat) = read_gif(&path);
    assert!(read == pictures);
    assert_eq!(delays, [4; 6]);
    assert_eq!(repeat, gif::Repeat::Infinite);
}

/// A GIF of many colours approximates its pictures closely, since every frame has its own palette.
#[test]
fn a_gif_of_many_colors_is_close() {
    let folder = folder();
    let path = folder.path().join("film.gif");
    let pictures: Vec<_> = (0..6).map(many_colors).collect();
    write(&path, 25.0, &pictures);
    let (read, ..) = read_gif(&path);
    for (read, picture) in read.iter().zip(&pictures) {
        assert!(difference(read, picture) < 6.0, "{}", difference(read, picture));
    }
    // The measure distinguishes frames.
    assert!(difference(&read[0], &pictures[3]) > 20.0);
}

/// A GIF plays at its rate, although its delays are multiples of 1/100 s: each differs by less than one,
/// and their sum by at most half of one.
#[test]
fn delays_of_a_gif_do_not_drift() {
    let folder = folder();
    let path = folder.path().join("film.gif");
    let pictures: Vec<_> = (0..50).map(|_| RgbImage::new(SIZE.x, SIZE.y)).collect();
    for fps in [30.0, 24.0, 29.97, 50.0, 7.0] {
        write(&path, fps, &pictures);
        let (_, delays, _) = read_gif(&path);
        let mut sum = 0;
        for (frame, delay) in (1..).zip(delays) {
            sum += u32::from(delay);
            let time = f64::from(frame) * 100.0 / fps;
            assert!((f64::from(sum) - time).abs() <= 0.5, "{fps}: frame {frame} ends at {sum}");
            assert!((f64::from(delay) - 100.0 / fps).abs() < 1.0);
        }
    }
}

/// A video has the right properties and, decoded by the matrix that it names, the colours of its
/// pictures.
#[test]
fn videos_have_the_right_properties_and_colors() {
    if !ffmpeg() {
        return;
    }
    // Saturated colours, for which the matrices differ most, and a picture with gradients.
    let colors = [[200, 30, 60], [20, 180, 40], [30, 60, 210], [128, 128, 128]];
    let mut pictures: Vec<_> =
        colors.into_iter().map(|color| RgbImage::from_pixel(SIZE.x, SIZE.y, Rgb(color))).collect();
    pictures.push(many_colors(4));
    for (kind, codec) in [("mp4", "h264"), ("webm", "vp9")] {
        let folder = folder();
        // A name that ffmpeg would read as a protocol without the prefix `file:`.
        let path = folder.path().join(format!("a:b %d 'c'.{kind}"));
        write(&path, 29.97, &pictures);
        let entries = "stream=codec_name,width,height,pix_fmt,color_range,color_space,\
                       r_frame_rate,nb_read_frames";
        let output = Command::new("ffprobe")
            .args(["-v", "error", "-count_frames", "-of", "default=nw=1:nk=0"])
            .args(["-show_entries", entries])
            .arg(file_url(&path))
            .output()
            .unwrap();
        let output = String::from_utf8(output.stdout).unwrap();
        for expected in [
            &format!("codec_name={codec}"),
            "width=160",
            "height=120",
            "pix_fmt=yuv420p",
            "color_range=tv",
            "color_space=bt709",
            "r_frame_rate=2997/100",
            "nb_read_frames=5",
        ] {
            assert!(output.lines().any(|line| line == expected), "{expected}: {output}");
        }
        let by_tag = decode(&path, "auto");
        let by_other = decode(&path, "bt601");
        assert_eq!(by_tag.len(), 5);
        for (i, picture) in pictures.iter().enumerate() {
            let [near, far] = [&by_tag, &by_other].map(|all| difference(&all[i], picture));
            assert!(near < 2.5, "{kind}: frame {i} is off by {near}");
            // The measure distinguishes the matrices, except for grey.
            assert!(far > 4.0 || i == 3, "{kind}: frame {i} by another matrix is off by {far}");
        }
    }
}

/// Videos of the same pictures are the same bytes, without random names inside.
#[test]
fn videos_are_reproducible() {
    if !ffmpeg() {
        return;
    }
    for kind in ["mp4", "webm"] {
        let [one, other] = [(); 2].map(|()| {
            let folder = folder();
            let path = folder.path().join("film").with_extension(kind);
            write(&path, 25.0, &[many_colors(1), many_colors(2)]);
            fs::read(path).unwrap()
        });
        assert!(one == other, "{kind}");
    }
}

/// The index of an MP4 precedes its pictures, so that it plays while it is still being downloaded.
#[test]
fn an_mp4_begins_with_its_index() {
    if !ffmpeg() {
        return;
    }
    let folder = folder();
    let path = folder.path().join("film.mp4");
    write(&path, 30.0, &[many_colors(0), many_colors(1)]);
    let bytes = fs::read(path).unwrap();
    let at = |name: &[u8]| bytes.windows(4).position(|window| window == name).unwrap();
    assert!(at(b"moov") < at(b"mdat"));
}

/// An unfinished film leaves no file and no process, and does not replace an earlier film.
#[test]
fn a_dropped_film_leaves_nothing() {
    for name in ["film.gif", "film.apng", "film.mp4", "film.webm"] {
        if matches!(FilmFormat::of(Path::new(name)), Some(FilmFormat::Mp4 | FilmFormat::Webm))
            && !ffmpeg()
        {
            continue;
        }
        let folder = folder();
        let path = folder.path().join(name);
        let before = "GIF89a: a film that was there before";
        fs::write(&path, before).unwrap();
        let mut film = Film::create(&path, SIZE, 30.0).unwrap();
        for frame in 0..3 {
            film.push(&many_colors(frame)).unwrap();
        }
        assert_eq!(names(folder.path()).len(), 2, "{name}: no temporary file");
        // A running encoder is counted.
        let video = name.ends_with("mp4") || name.ends_with("webm");
        assert!(!cfg!(target_os = "linux") || processes(folder.path()) == usize::from(video));
        drop(film);
        assert_eq!(processes(folder.path()), 0, "{name}");
        assert_eq!(names(folder.path()), [name.into()].into());
        assert_eq!(fs::read_to_string(&path).unwrap(), before);
    }
}

/// A format, size or rate that no film can have is refused at once, with the remedy, and nothing is
/// written.
#[test]
fn invalid_films_are_refused() {
    let folder = folder();
    let refusal = |name: &str, size: [u32; 2], fps: f64| {
        let made = Film::create(&folder.path().join(name), size.into(), fps);
        let error = made.map(|_| ()).expect_err(name);
        assert!(matches!(error, Error::Usage(_)), "{error:?}");
        error.to_string()
    };
    let cases = [
        (refusal("film.avi", [160, 120], 30.0), ".mp4, .webm, .gif or .apng"),
        (refusal("film", [160, 120], 30.0), ".mp4, .webm, .gif or .apng"),
        (refusal("film.mp4", [161, 120], 30.0), "162x120"),
        (refusal("film.webm", [161, 119], 30.0), "162x120"),
        (refusal("film.gif", [160, 120], 60.0), ".apng"),
        (refusal("film.gif", [70000, 120], 30.0), "65535"),
        (refusal("film.apng", [0, 120], 30.0), "0x120"),
        (refusal("film.apng", [160, 120], 0.0), "between 0.01 and 1000"),
        (refusal("film.gif", [160, 120], f64::NAN), "between 0.01 and 1000"),
    ];
    for (error, expected) in cases {
        assert!(error.contains(expected), "`{expected}` is missing in: {error}");
    }
    assert_eq!(names(folder.path()), BTreeSet::new());
    // Only videos refuse odd sizes.
    Film::create(&folder.path().join("film.GIF"), UVec2::new(161, 119), 50.0).unwrap();

    let nowhere = folder.path().join("nowhere/film.gif");
    let error = Film::create(&nowhere, SIZE, 30.0).map(|_| ()).unwrap_err();
    assert!(matches!(error, Error::Io { .. }) && error.to_string().contains("nowhere/film.gif"));
    let directory = folder.path().join("directory.gif");
    fs::create_dir(&directory).unwrap();
    Film::create(&directory, SIZE, 30.0).map(|_| ()).unwrap_err();

    let mut film = Film::create(&folder.path().join("film.gif"), SIZE, 30.0).unwrap();
    let error = film.push(&RgbImage::new(120, 160)).unwrap_err();
    assert!(matches!(error, Error::Mismatch(_)), "{error:?}");
    let error = film.finish().unwrap_err();
    assert!(error.to_string().contains("a film without pictures"), "{error}");
    assert_eq!(names(folder.path()), ["directory.gif".into()].into());
}
