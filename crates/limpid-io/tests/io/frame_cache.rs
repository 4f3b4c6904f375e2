//! The frame cache: frames are loaded ahead of playback in any direction, within the memory budget, and
//! a bad frame does not affect the others.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex};

use glam::Vec3;
use limpid::liquid::Particles;
use limpid::liquid::classify::{Splat, Splats};
use limpid_io::Error;
use limpid_io::Result;
use limpid_io::frame_cache::{CacheState, FrameCache};
use limpid_io::input::{Input, Loaded};
use limpid_io::particles;

/// A frame with this number and this many splats.
fn frame(number: usize, splats: usize) -> Loaded {
    let splat: Splat = bytemuck::Zeroable::zeroed();
    Loaded {
        number: number as i64,
        particles: splats,
        splats: Splats { aggregates: vec![splat; splats], ..Splats::default() },
        ..Loaded::default()
    }
}

/// Records the frames that have loaded or failed, and waits for a number of them.
#[derive(Clone, Default)]
struct Finished(Arc<(Mutex<Vec<usize>>, Condvar)>);

impl Finished {
    fn note(&self, i: usize) {
        self.0.0.lock().unwrap().push(i);
        self.0.1.notify_all();
    }

    fn wait_for(&self, count: usize) -> Vec<usize> {
        let mut finished = self.0.0.lock().unwrap();
        while finished.len() < count {
            finished = self.0.1.wait(finished).unwrap();
        }
        finished.clone()
    }
}

fn cache(
    count: usize,
    budget: u64,
    workers: usize,
    load: impl Fn(usize) -> Result<Loaded> + Send + Sync + 'static,
) -> (FrameCache, Finished) {
    let finished = Finished::default();
    let note = finished.clone();
    (FrameCache::new(count, budget, workers, load, move |i| note.note(i)), finished)
}

/// The current frame is loaded first, then as many of those ahead as fit the budget.
#[test]
fn frames_are_loaded_in_order_of_playback() {
    let bytes = frame(0, 100).bytes();
    let gate = Arc::new((Mutex::new(false), Condvar::new()));
    let opened = gate.clone();
    let (cache, finished) = cache(100, 5 * bytes, 1, move |i| {
        let mut open = opened.0.lock().unwrap();
        while !*open {
            open = opened.1.wait(open).unwrap();
        }
        Ok(frame(i, 100))
    });
    // The worker may have started with frame 0 before the aim is set.
    cache.aim(50, 1, false);
    *gate.0.lock().unwrap() = true;
    gate.1.notify_all();
    let mut first = finished.wait_for(5);
    first.retain(|&i| i != 0);
    assert_eq!(first[..4], [50, 51, 52, 53]);
    cache.wait(54).unwrap();
    cache.aim(50, 1, false);
    cache.wait(50).unwrap();
    let state = cache.state();
    assert!(state.loaded.contains(&50) && state.bytes <= state.budget, "{state:?}");
    assert_eq!(cache.get(50).expect("it is loaded").unwrap().number, 50);
    assert!(cache.get(99).is_none(), "it does not fit the budget");
}

/// Playback backwards, around the ends, and with jumps.
#[test]
fn frames_load_in_any_direction() {
    let bytes = frame(0, 10).bytes();
    let (cache, _) = cache(20, 6 * bytes, 2, |i| Ok(frame(i, 10)));
    for i in (0..20).rev().chain([0, 19, 7, 3, 12]).chain(0..20) {
        cache.aim(i, -1, true);
        assert_eq!(cache.wait(i).unwrap().number, i as i64);
        assert!(cache.state().bytes <= 6 * bytes);
    }
    // In a loop, the first frames follow the last.
    cache.aim(18, 1, true);
    for i in [18, 19, 0, 1] {
        cache.wait(i).unwrap();
    }
    assert!(cache.wait(20).is_err(), "no such frame");
}

/// A thousand frames of different sizes never exceed the budget, including those being loaded.
#[test]
fn memory_stays_within_the_budget() {
    let size = |i: usize| 200 + 37 * (i * 7919 % 101);
    let budget = 12 * frame(0, size(0)).bytes() + 60 * frame(0, 3900).bytes() / 10;
    let (cache, _) = cache(1000, budget, 3, move |i| Ok(frame(i, size(i))));
    for i in 0..1000 {
        cache.aim(i, 1, false);
        assert_eq!(cache.wait(i).unwrap().particles, size(i));
        let CacheState { bytes, most, loaded, .. } = cache.state();
        assert!(bytes <= budget && most <= budget, "{i}: {bytes}, {most} of {budget}");
        let held: u64 = loaded.iter().map(|&i| frame(i, size(i)).bytes()).sum();
        assert!(held <= bytes, "{i}: loaded frames are counted");
    }
}

/// One frame is always loaded, however large.
#[test]
fn a_frame_larger_than_the_budget_is_loaded() {
    let (cache, _) = cache(10, 1, 2, |i| Ok(frame(i, 1000)));
    for i in [0, 1, 2, 9, 0] {
        assert_eq!(cache.wait(i).unwrap().number, i as i64);
        let state = cache.state();
        assert!(state.loaded.len() + state.loading.len() <= 1, "{state:?}");
    }
}

/// A damaged frame has its own error, and the others load.
#[test]
fn a_bad_frame_does_not_affect_the_others() {
    let tries = Arc::new(AtomicUsize::new(0));
    let tried = tries.clone();
    let (cache, finished) = cache(5, 1 << 20, 2, move |i| {
        if i == 2 {
            tried.fetch_add(1, Ordering::Relaxed);
            return Err(Error::Usage("damaged".into()));
        }
        Ok(frame(i, 1))
    });
    let mut all = finished.wait_for(5);
    all.sort_unstable();
    assert_eq!(all, [0, 1, 2, 3, 4]);
    let error = cache.wait(2).unwrap_err();
    assert_eq!((error.to_string().as_str(), error.category() as u8), ("damaged", 2));
    assert!(cache.get(2).expect("it has finished").is_err());
    assert_eq!(cache.state().failed, [2]);
    assert_eq!(cache.state().loaded, [0, 1, 3, 4]);
    assert!(cache.wait(2).is_err());
    let tries = tries.load(Ordering::Relaxed);
    assert_eq!(tries, 2, "once ahead of playback and once as the current frame");
}

/// A frame that failed, as one read while it is written, is loaded again when it becomes the current
/// one.
#[test]
fn a_failed_frame_is_retried() {
    let whole = Arc::new(AtomicUsize::new(0));
    let written = whole.clone();
    let (cache, finished) = cache(3, 1 << 20, 1, move |i| match written.load(Ordering::Relaxed) {
        0 if i == 1 => Err(Error::Usage("it changed while it was read".into())),
        _ => Ok(frame(i, 1)),
    });
    finished.wait_for(3);
    assert!(cache.get(1).expect("it has finished").is_err());
    whole.store(1, Ordering::Relaxed);
    assert_eq!(cache.wait(1).unwrap().number, 1);
    assert!(cache.state().failed.is_empty());
}

/// Neither queries nor the drop of a cache wait for a slow frame.
#[test]
fn only_wait_blocks() {
    let gate = Arc::new(Mutex::new(()));
    let (entered, has_entered) = std::sync::mpsc::channel();
    let closed = gate.clone();
    let guard = gate.lock().unwrap();
    let entered = Mutex::new(entered);
    let (cache, finished) = cache(3, 1 << 20, 1, move |i| {
        entered.lock().unwrap().send(i).unwrap();
        drop(closed.lock());
        Ok(frame(i, 1))
    });
    assert_eq!(has_entered.recv().unwrap(), 0);
    assert!(cache.get(0).is_none());
    assert_eq!(cache.state().loading, [0]);
    cache.aim(1, 1, false);
    drop(cache);
    drop(guard);
    assert_eq!(finished.wait_for(1), [0], "only the frame being loaded finishes");
}

/// A panic while loading is an error of that frame, so that no caller waits forever.
#[test]
fn a_panic_while_loading_is_an_error() {
    let (cache, _) = cache(3, 1 << 20, 1, |i| {
        assert!(i != 1, "planted");
        Ok(frame(i, 1))
    });
    assert!(cache.wait(1).unwrap_err().to_string().contains("a bug in limpid"));
    assert_eq!(cache.wait(2).unwrap().number, 2, "the worker continues");
}

/// In fast motion, the frames to be shown are loaded before the skipped ones.
#[test]
fn skipped_frames_are_loaded_last() {
    let bytes = frame(0, 100).bytes();
    let (cache, finished) = cache(100, 5 * bytes, 1, |i| Ok(frame(i, 100)));
    cache.wait(0).unwrap();
    cache.aim(40, 4, false);
    // Frames behind 40 may have been loading already; those to be shown follow.
    let mut order = finished.wait_for(1);
    let shown = loop {
        match order.iter().position(|&i| i == 40).map(|at| order[at..].to_vec()) {
            Some(shown) if shown.len() >= 4 => break shown,
            _ => order = finished.wait_for(order.len() + 1),
        }
    };
    assert_eq!(shown[..4], [40, 44, 48, 52]);
}

/// Small frames are loaded by one thread each, once their size is known, and large ones by all. A film's frames are those
/// that are loaded alone.
#[test]
fn small_frames_are_loaded_by_one_thread_each() {
    let folder = tempfile::tempdir().unwrap();
    let counts = [3000, 3000, 3000, 9000, 9000, 3000];
    for (i, &count) in counts.iter().enumerate() {
        let place = |k: u32| Vec3::new((k % 30) as f32, (k / 30 % 10) as f32, (k / 300) as f32);
        let wave = |p: Vec3| Vec3::Y * (0.4 * p.x + i as f32).sin() * p.y / 10.0;
        let places = (0..count).map(place).map(|p| 0.05 * (p + wave(p))).collect();
        let path = folder.path().join(format!("{i}.ply"));
        particles::write(&Particles::from_positions(places), &path).unwrap();
    }
    let input = Input::open(folder.path().join("{}.ply")).unwrap();
    let (loader, project) = input.resolve().unwrap();
    let frame = move |i: usize| loader.load(&loader.sequence.frames[i], &project.scene);
    let alone: Vec<_> = (0..counts.len()).map(|i| frame(i).unwrap().splats).collect();

    let seen = Arc::new(Mutex::new(Vec::new()));
    let threads = seen.clone();
    let (cache, _) = cache(counts.len(), u64::MAX, 1, move |i| {
        threads.lock().unwrap().push(rayon::current_num_threads());
        frame(i)
    });
    for (i, alone) in alone.iter().enumerate() {
        assert!(cache.wait(i).unwrap().splats == *alone, "frame {i}");
    }
    let all = rayon::current_num_threads();
    assert_eq!(*seen.lock().unwrap(), [all, 1, 1, 1, all, all]);
}
