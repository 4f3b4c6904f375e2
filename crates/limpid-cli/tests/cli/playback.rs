//! Slow motion and gaps: interpolation between frames, and missing frames.

use std::path::Path;

use glam::{DVec3, Vec3};
use limpid::liquid::Particles;
use limpid_io::Error;
use limpid_io::frames::FrameSpec;
use limpid_io::input::{FrameTime, Input, Loader, Missing};

use crate::support::frames::{gpu, noise};

const G: Vec3 = Vec3::new(0.0, -9.81, 0.0);

/// Particles in ballistic flight with different velocities, after `t` seconds.
fn thrown(t: f32) -> Particles {
    let starts = [Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0), Vec3::new(-4.0, 0.5, 0.0)];
    let throws = [Vec3::new(3.0, 4.0, 0.0), Vec3::new(0.0, 1.0, -2.0), Vec3::new(0.5, -6.0, 1.0)];
    let position = |(x, v): (&Vec3, &Vec3)| *x + *v * t + G * (0.5 * t * t);
    Particles {
        velocities: Some(throws.iter().map(|v| *v + G * t).collect()),
        ids: Some(vec![10, 20, 30]),
        ..Particles::from_positions(starts.iter().zip(&throws).map(position).collect())
    }
}

fn assert_near(a: &[Vec3], b: &[Vec3]) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert!(a.abs_diff_eq(*b, 2e-5), "{a}, {b} expected");
    }
}

/// Ids shared by many particles, such as a material or a phase, are ignored: particles are matched by
/// their order.
#[test]
fn repeated_ids_are_ignored() {
    let grid = |shift: f32| {
        let place = |i: usize| Vec3::new((i % 10) as f32 + shift, (i / 10) as f32, 0.0);
        let ids = Some((0..100).map(|i| i % 2).collect());
        Particles { ids, ..Particles::from_positions((0..100).map(place).collect()) }
    };
    let between = Particles::between(&grid(0.0), &grid(0.4), 0.5);
    assert_near(&between.positions, &grid(0.2).positions);
}

/// Ballistic flight is exact at any time between the frames, although the interval's duration is not
/// given; with ids the order of the file does not matter; at the frames' own times the particles are
/// unchanged.
#[test]
fn flight_between_frames_is_exact() {
    let (from, duration) = (0.3, 0.04);
    let (a, b) = (thrown(from), thrown(from + duration));
    let shuffled = |p: &Particles| Particles {
        positions: [2, 0, 1].map(|i| p.positions[i]).to_vec(),
        velocities: p.velocities.as_ref().map(|v| [2, 0, 1].map(|i| v[i]).to_vec()),
        ids: p.ids.as_ref().map(|ids| [2, 0, 1].map(|i| ids[i]).to_vec()),
        ..p.clone()
    };
    for b in [b.clone(), shuffled(&b)] {
        for fraction in [0.1, 0.25, 0.5, 0.9] {
            let expected = thrown(from + fraction as f32 * duration);
            let between = Particles::between(&a, &b, fraction);
            assert_near(&between.positions, &expected.positions);
            assert_near(&between.velocities.unwrap(), &expected.velocities.unwrap());
            assert_eq!(between.ids, a.ids);
        }
        assert_eq!(Particles::between(&a, &b, 0.0), a);
        assert_eq!(Particles::between(&a, &b, 1.0), b);
    }
}

/// Without velocities, or with velocities inconsistent with the displacement, particles move on straight
/// lines; without ids they are matched by order; without ids and with different counts the nearer frame
/// is held.
#[test]
fn interpolation_without_velocities() {
    let bare = |particles: &Particles| Particles::from_positions(particles.positions.clone());
    let (a, b) = (bare(&thrown(0.0)), bare(&thrown(0.1)));
    let middle = Particles::between(&a, &b, 0.5);
    let expected: Vec<_> = (0..3).map(|i| a.positions[i].midpoint(b.positions[i])).collect();
    assert_near(&middle.positions, &expected);

    let still = |p: &Particles| Particles { velocities: Some(vec![Vec3::ZERO; 3]), ..p.clone() };
    assert_near(&Particles::between(&still(&a), &still(&b), 0.5).positions, &expected);

    let fewer = Particles::from_positions(vec![Vec3::ONE]);
    assert_eq!(Particles::between(&a, &fewer, 0.4), a);
    assert_eq!(Particles::between(&a, &fewer, 0.6), fewer);
}

/// A particle present in one frame only is shown for that frame's half of the interval, and moves.
#[test]
fn particles_appear_and_disappear() {
    let duration = 0.1;
    let (mut a, mut b) = (thrown(0.0), thrown(duration));
    a.ids = Some(vec![10, 20, 31]);
    b.ids = Some(vec![10, 20, 32]);
    let early = Particles::between(&a, &b, 0.25);
    assert_eq!(early.ids, Some(vec![10, 20, 31]));
    let v = a.velocities.as_ref().unwrap()[2];
    assert_near(&early.positions[2..], &[a.positions[2] + v * (0.25 * duration)]);
    let late = Particles::between(&a, &b, 0.75);
    assert_eq!(late.ids, Some(vec![10, 20, 32]));
    let v = b.velocities.as_ref().unwrap()[2];
    assert_near(&late.positions[2..], &[b.positions[2] - v * (0.25 * duration)]);
    // Repeated ids, and frames without particles.
    a.ids = Some(vec![1, 1, 1]);
    assert_eq!(Particles::between(&a, &b, 0.5).len(), 3);
    assert!(Particles::between(&Particles::default(), &b, 0.4).is_empty());
}

/// Frames with different origins are interpolated at their world positions.
#[test]
fn origins_may_differ() {
    let far = DVec3::new(1e7, 0.0, -2e6);
    let frame = |x: f64| Particles::from_places(&[far + DVec3::X * x, far + DVec3::Y]);
    let (a, b) = (frame(0.0), frame(4.0));
    let between = Particles::between(&a, &b, 0.25);
    let found = between.origin + between.positions[0].as_dvec3() - far;
    assert!(found.abs_diff_eq(DVec3::X, 1e-6), "{found}");
}

/// A block of particles 0.1 apart in a unit box, with ids and a common velocity.
fn block(velocity: Vec3) -> Particles {
    let at =
        |i: i64| (Vec3::new((i % 10) as f32, (i / 10 % 10) as f32, (i / 100) as f32) + 0.5) * 0.1;
    Particles {
        velocities: Some(vec![velocity; 1000]),
        ids: Some((0..1000).collect()),
        ..Particles::from_positions((0..1000).map(at).collect())
    }
}

/// The same block after a time, in a periodic box with sides of length 1.
fn advected(a: &Particles, time: f32) -> Particles {
    let velocities = a.velocities.clone().unwrap();
    let position = |(x, v): (&Vec3, &Vec3)| (*x + *v * time).rem_euclid(Vec3::ONE);
    let positions = a.positions.iter().zip(&velocities).map(position).collect();
    Particles { positions, ..a.clone() }
}

/// In a periodic box no particle crosses the picture from one side to the other, and those that cross no
/// border are interpolated exactly, with velocities and without.
#[test]
fn particles_jump_across_periodic_borders() {
    let a = block(Vec3::new(2.0, 0.0, 0.3));
    let b = advected(&a, 0.1);
    for velocities in [true, false] {
        let stripped = |p: &Particles| Particles {
            velocities: p.velocities.clone().filter(|_| velocities),
            ..p.clone()
        };
        for fraction in [0.1f32, 0.4, 0.6, 0.9] {
            let between = Particles::between(&stripped(&a), &stripped(&b), fraction.into());
            assert_eq!(between.len(), 1000);
            let exact = advected(&a, 0.1 * fraction);
            let ids = between.ids.as_ref().unwrap();
            let off = |(id, x): (&i64, &Vec3)| {
                let d = *x - exact.positions[*id as usize];
                (d - d.round()).length()
            };
            let off: Vec<_> = ids.iter().zip(&between.positions).map(off).collect();
            let wrong = off.iter().filter(|&&off| off > 1e-4).count();
            let max = off.iter().fold(0.0f32, |max, &off| max.max(off));
            if velocities {
                assert_eq!(wrong, 0, "at {fraction}");
            } else {
                // Particles that cross a border are held: two of the ten layers.
                assert!(wrong <= 200 && max < 0.13, "{wrong} at {fraction}, by {max}");
            }
        }
    }
}

/// A particle whose id was reused elsewhere, here one in a hundred, is shown at its old position for one
/// half of the interval and at the new one for the other; the others are interpolated exactly.
#[test]
fn particles_with_reused_ids_jump() {
    let a = block(Vec3::new(0.3, -0.2, 0.1));
    let velocities = a.velocities.clone().unwrap();
    let mut b = a.clone();
    for (x, v) in b.positions.iter_mut().zip(&velocities) {
        *x += *v * 0.04;
    }
    let reused = |i: usize| i % 100 == 7;
    for i in (0..1000).filter(|&i| reused(i)) {
        b.positions[i] += Vec3::new(3.0, 1.0, 0.0);
    }
    for fraction in [0.25f32, 0.75] {
        let between = Particles::between(&a, &b, fraction.into());
        assert_eq!(between.len(), 1000);
        for (i, v) in velocities.iter().enumerate() {
            let far = reused(i) && fraction > 0.5;
            let shift = if far { Vec3::new(3.0, 1.0, 0.0) } else { Vec3::ZERO };
            let expected = a.positions[i] + v * 0.04 * fraction + shift;
            assert!(between.positions[i].abs_diff_eq(expected, 1e-5), "{i} at {fraction}");
        }
    }
}

/// Without ids, particles are matched by order only where their motion is plausible; a shuffled file
/// shows the nearer frame.
#[test]
fn shuffled_files_are_held() {
    let a = Particles { ids: None, ..block(Vec3::new(0.3, -0.2, 0.1)) };
    let mut b = a.clone();
    let velocities = a.velocities.clone().unwrap();
    for (x, v) in b.positions.iter_mut().zip(&velocities) {
        *x += *v * 0.04;
    }
    let mut shuffled = b.clone();
    let mut seed = 5;
    for i in (1..1000).rev() {
        shuffled.positions.swap(i, (noise(&mut seed) * (i + 1) as f32) as usize);
    }
    for with_velocities in [true, false] {
        let stripped = |p: &Particles| Particles {
            velocities: p.velocities.clone().filter(|_| with_velocities),
            ..p.clone()
        };
        let (a, b, shuffled) = (stripped(&a), stripped(&b), stripped(&shuffled));
        let middle: Vec<_> =
            a.positions.iter().zip(&b.positions).map(|(a, b)| a.midpoint(*b)).collect();
        assert_near(&Particles::between(&a, &b, 0.5).positions, &middle);
        assert_eq!(Particles::between(&a, &shuffled, 0.4), a);
        assert_eq!(Particles::between(&a, &shuffled, 0.6), shuffled);
    }
}

/// Writes and opens a sequence of frames with these numbers.
fn open(folder: &Path, numbers: &[i64]) -> Loader {
    for number in numbers {
        let text = format!("{number} 0 0\n{number} 1 0\n");
        std::fs::write(folder.join(format!("w_{number}.xyz")), text).unwrap();
    }
    Input::open(folder.join("w_{}.xyz").to_str().unwrap()).unwrap().loader
}

/// Frame times advance by equal steps from the first frame to the last, also across gaps, and meet every
/// frame exactly.
#[test]
fn frame_times_meet_the_frames() {
    let folder = tempfile::tempdir().unwrap();
    let input = open(folder.path(), &[3, 4, 6]);
    let numbers = [3, 4, 6];
    assert_eq!(input.frame_times(&numbers, 1.0), numbers.map(FrameTime::at));
    let quarter = input.frame_times(&numbers, 0.25);
    assert_eq!(quarter.len(), 13);
    assert_eq!(quarter[1], FrameTime { frame: 3, next: 4, fraction: 0.25 });
    assert_eq!(quarter[4], FrameTime::at(4));
    assert_eq!(quarter[8], FrameTime { frame: 4, next: 6, fraction: 0.5 });
    assert_eq!(quarter[12], FrameTime::at(6));
    // Steps that are not binary fractions meet the frames too, including the last.
    let tenth = input.frame_times(&numbers, 0.1);
    assert_eq!((tenth.len(), tenth[10], tenth[30]), (31, FrameTime::at(4), FrameTime::at(6)));
    let double = input.frame_times(&(0..=10).collect::<Vec<_>>(), 2.0);
    assert_eq!(double, [0, 2, 4, 6, 8, 10].map(FrameTime::at));
    assert!(input.frame_times(&[], 0.5).is_empty());
    assert_eq!(input.frame_times(&[4], 0.5), [FrameTime::at(4)]);

    let at = |frame_time| input.particles(frame_time).unwrap().positions[0].x;
    assert_eq!(at(quarter[8]), 5.0);
    assert_eq!(at(quarter[4]), 4.0);
}

/// A constant stride of the numbers, as of a simulation that writes every hundredth step, counts as one
/// frame: slow motion has as many frame times as for frames 0 to 3.
#[test]
fn a_constant_stride_is_one_frame() {
    let folder = tempfile::tempdir().unwrap();
    let numbers = [0, 100, 200, 300];
    let mut input = open(folder.path(), &numbers);
    assert_eq!(input.sequence.stride(), 100);
    assert_eq!(input.frame_times(&numbers, 0.99).len(), 4);
    let halves = input.frame_times(&numbers, 0.5);
    let half = FrameTime { frame: 100, next: 200, fraction: 0.5 };
    assert_eq!((halves.len(), halves[3], halves[6]), (7, half, FrameTime::at(300)));
    input.missing = Missing::Hold;
    assert_eq!(FrameSpec::All.numbers(&input.sequence, input.missing).unwrap(), numbers);
    assert!(input.sequence.gaps().is_empty());

    let folder = tempfile::tempdir().unwrap();
    let gap = open(folder.path(), &[-40, -20, 40]).sequence;
    assert_eq!((gap.stride(), gap.gaps()), (20, vec![(0, 20)]));
    let held = FrameSpec::All.numbers(&gap, Missing::Hold).unwrap();
    assert_eq!(held, [-40, -20, 0, 20, 40]);
}

/// A time outside the sequence is an error that names its range.
#[test]
fn times_beyond_the_frames_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let input = open(folder.path(), &[3, 4, 6]);
    let at = |time| input.frame_time(&[3, 4, 6], time);
    assert_eq!(at(6.0).unwrap(), FrameTime::at(6));
    assert_eq!(at(5.0).unwrap(), FrameTime { frame: 4, next: 6, fraction: 0.5 });
    for time in [2.9, 6.1, f64::NAN, f64::INFINITY, -1e300] {
        let error = at(time).unwrap_err();
        assert!(matches!(error, Error::Sequence { .. }));
        assert!(error.to_string().contains("3 to 6"), "{error}");
    }
}

/// Extreme frame numbers neither overflow nor lose the frame times between them.
#[test]
fn frame_numbers_may_be_extreme() {
    let folder = tempfile::tempdir().unwrap();
    let (min, max) = (i64::MIN, i64::MAX);
    let close = [max - 4, max - 2, max];
    let input = open(folder.path(), &close);
    let halves = input.frame_times(&close, 0.5);
    assert_eq!(halves[1], FrameTime { frame: max - 4, next: max - 2, fraction: 0.5 });
    assert!(halves[1].time().is_finite());
    assert_eq!(FrameSpec::All.numbers(&input.sequence, Missing::Hold).unwrap(), close);

    let folder = tempfile::tempdir().unwrap();
    let apart = [min, 0, max];
    let input = open(folder.path(), &apart);
    assert_eq!(FrameSpec::All.numbers(&input.sequence, Missing::Hold).unwrap(), apart);
    let middle = input.frame_time(&apart, 2f64.powi(62)).unwrap();
    assert!(middle.frame == 0 && (middle.fraction - 0.5).abs() < 1e-9);

    let folder = tempfile::tempdir().unwrap();
    let gap = open(folder.path(), &[min, min + 1, max]).sequence;
    assert_eq!(gap.gaps(), [(min + 2, max - 1)]);
    assert!(FrameSpec::All.numbers(&gap, Missing::Hold).is_err());
}

/// `--missing`: an error that names the frame, an empty frame, or the previous frame.
#[test]
fn missing_frames() {
    let folder = tempfile::tempdir().unwrap();
    let mut input = open(folder.path(), &[3, 4, 7]);
    let all = |input: &Loader| FrameSpec::All.numbers(&input.sequence, input.missing).unwrap();
    let count = |input: &Loader, number| input.particles(FrameTime::at(number)).map(|p| p.len());

    assert_eq!(all(&input), [3, 4, 7]);
    assert!(matches!(count(&input, 5), Err(Error::MissingFrame { frame: 5, .. })));
    let spec: FrameSpec = "4-6".parse().unwrap();
    assert!(spec.numbers(&input.sequence, input.missing).is_err());

    input.missing = Missing::Empty;
    assert_eq!(all(&input), [3, 4, 5, 6, 7]);
    assert_eq!(spec.numbers(&input.sequence, input.missing).unwrap(), [4, 5, 6]);
    assert_eq!(count(&input, 5).unwrap(), 0);
    assert_eq!(count(&input, 7).unwrap(), 2);

    input.missing = Missing::Hold;
    let x = |number| input.particles(FrameTime::at(number)).unwrap().positions[0].x;
    assert_eq!([4, 5, 6, 7, 9].map(x), [4.0, 4.0, 4.0, 7.0, 7.0]);
    assert_eq!(count(&input, 2).unwrap(), 0, "a frame before the first is held");
    assert!("nothing".parse::<Missing>().is_err());
}

/// Runs `limpid render` over frames 1, 2 and 4 of a small moving block; returns the pictures by name, or
/// stderr.
fn render(arguments: &[&str]) -> Result<Vec<(String, Vec<u8>)>, String> {
    let folder = tempfile::tempdir().unwrap();
    for number in [1, 2, 4] {
        let grid = || (0..4).map(|i| 0.05 * f64::from(i));
        let places = grid().flat_map(|x| grid().flat_map(move |y| grid().map(move |z| (x, y, z))));
        let line =
            |(x, y, z): (f64, f64, f64)| format!("{} {y} {z}\n", x + 0.1 * f64::from(number));
        let text: String = places.map(line).collect();
        std::fs::write(folder.path().join(format!("w_{number}.xyz")), text).unwrap();
    }
    let output = assert_cmd::Command::new(env!("CARGO_BIN_EXE_limpid"))
        .current_dir(folder.path())
        .args([
            "render", "--quiet", "w_{}.xyz", "--size", "48x36", "--radius", "0.025", "-o", "out/",
        ])
        .args(arguments)
        .output()
        .unwrap();
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into_owned());
    }
    let pictures = std::fs::read_dir(folder.path().join("out")).unwrap();
    let mut pictures: Vec<_> = pictures
        .map(|entry| {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            // Only pixels: the fingerprint in the file depends on the folder.
            (name, image::open(path).unwrap().into_rgb8().into_raw())
        })
        .collect();
    pictures.sort();
    Ok(pictures)
}

/// On the command line slow motion numbers its pictures and shows each frame exactly at its time, shards
/// have the same pictures, and missing frames are reported, held or empty.
#[test]
fn slow_motion_and_gaps_on_the_command_line() {
    let names = |pictures: &[(String, Vec<u8>)]| -> Vec<String> {
        pictures.iter().map(|(name, _)| name.clone()).collect()
    };
    let Some(_) = gpu() else { return };
    let plain = render(&[]).unwrap();
    assert_eq!(names(&plain), ["frame_0001.png", "frame_0002.png", "frame_0004.png"]);

    let slow = render(&["--speed", "0.5"]).unwrap();
    let seven: Vec<_> = (1..=7).map(|i| format!("frame_{i:04}.png")).collect();
    assert_eq!(names(&slow), seven);
    assert_eq!((&slow[2].1, &slow[6].1), (&plain[1].1, &plain[2].1));
    assert!(slow.windows(2).all(|pair| pair[0].1 != pair[1].1), "two frame times have one picture");
    let halves: Vec<_> = ["1/2", "2/2"]
        .iter()
        .flat_map(|shard| render(&["--speed", "0.5", "--shard", shard]).unwrap())
        .collect();
    assert!(halves.iter().all(|picture| slow.contains(picture)) && halves.len() == 7);

    let held = render(&["--missing", "hold"]).unwrap();
    assert_eq!(names(&held), seven[..4]);
    assert_eq!(held[2].1, plain[1].1);
    let empty = render(&["--missing", "empty"]).unwrap();
    assert_ne!(empty[2].1, plain[1].1);
    assert_eq!(empty[3].1, plain[2].1);

    let error = render(&["--frames", "1-4"]).unwrap_err();
    assert!(error.contains("1 of 4 frames are missing: 3"), "{error}");
    // A time outside the frames is an error, not the last frame.
    for time in ["0", "4.5", "-3", "1e30"] {
        let error = render(&["--at", time]).unwrap_err();
        assert!(error.contains("is not in its frames, from 1 to 4"), "{error}");
    }
    for time in ["nan", "inf", "soon"] {
        let error = render(&["--at", time]).unwrap_err();
        assert!(error.contains("expected a time in frames"), "{error}");
    }
    let error = render(&["--speed", "0"]).unwrap_err();
    assert!(error.contains("--speed 0: expected 0.001 to 1000"), "{error}");
    let error = render(&["--speed", "0.5", "--frames", "4,1"]).unwrap_err();
    assert!(error.contains("in order"), "{error}");
}
