//! Several inputs beside each other: `limpid render A B --beside`. They have one camera, one scale and one clock, and each
//! its name below.

mod plan;
mod sizes;

use std::path::Path;
use std::sync::Arc;

use image::{DynamicImage, GenericImage as _};
use limpid::camera::View;
use limpid::liquid::Up;
use limpid::offscreen::Offscreen;
use limpid::scene::Scene;
use limpid_io::film::Shot;
use limpid_io::input::{FrameTime, Loaded, Loader};
use limpid_io::open::Opened;
use limpid_io::overlay::{self, Overlay};
use limpid_io::shared_classifier::SharedClassifier;

use self::plan::{Plan, Planned, of_input};
use self::sizes::Sizes;
use super::Args;
use super::console::Console;
use super::output::Output;
use super::pictures::DrawnPicture;
use crate::fingerprint::{Fingerprint, Fingerprints};
use crate::{pipeline_cache, signals};

/// One of the inputs.
struct Side {
    /// As given.
    source: String,
    loader: Loader,
    scene: Scene,
    /// Of each picture.
    times: Vec<FrameTime>,
    overlay: Overlay,
    fingerprints: Fingerprints,
    console: Console,
    /// The particles of the last picture, which may be those of the next.
    last: Option<(FrameTime, Arc<Loaded>)>,
}

pub(super) fn run(args: &Args) -> anyhow::Result<u8> {
    let Plan { inputs, sizes, shots, fps, camera_up, destination, notices } = Plan::new(args)?;
    signals::finish_first();
    let mut output = Output::open(destination, sizes.whole, fps)?;
    let (gpu, cache) = pipeline_cache::open_adapter()?;
    let classifier = SharedClassifier::on(&gpu);
    let bar = crate::terminal::progress(shots.len());
    notices.iter().for_each(|notice| Console::new(bar.clone()).notice(notice));
    let side = |planned| Side::new(planned, &sizes, &classifier, Console::new(bar.clone()));
    let mut sides: Vec<Side> = inputs.into_iter().map(side).collect();
    sides.iter().for_each(Side::tell_whether_held);
    let (mut offscreen, adapter) = (Offscreen::new(&gpu), gpu.adapter());
    for shot in &shots {
        // The unfinished film is removed.
        if let Some(code) = signals::received() {
            return Ok(code);
        }
        let mut picture = sizes.blank(sizes.whole);
        let told = (camera_up, adapter.as_str());
        for (side, left) in sides.iter_mut().zip(sizes.lefts()) {
            let drawn = side.draw(&mut offscreen, shot, &sizes, told);
            let drawn = drawn.map_err(|error| of_input(error, Path::new(&side.source)))?;
            picture.copy_from(&drawn, left, 0).expect("it fits");
        }
        let fingerprint = fingerprint(&sides, shot);
        output.write(
            shot,
            DrawnPicture { picture, radiance: None, images: Vec::new(), fingerprint },
        )?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    if let Some(cache) = cache {
        cache.save();
    }
    let summary = output.summary(&numbers_of(&shots), 0);
    output.finish()?;
    Console::new(bar).line(&summary);
    Ok(crate::SUCCESS)
}

fn numbers_of(shots: &[Shot]) -> Vec<i64> {
    shots.iter().map(|shot| shot.number).collect()
}

/// The fingerprint of the pictures of all sides together.
fn fingerprint(sides: &[Side], shot: &Shot) -> Fingerprint {
    let all: Vec<_> = sides.iter().map(|side| side.fingerprints.of(shot).to_string()).collect();
    sides[0].fingerprints.of(shot).with(&all.join(" "))
}

impl Side {
    fn new(
        planned: Planned,
        sizes: &Sizes,
        classifier: &SharedClassifier,
        console: Console,
    ) -> Self {
        let Planned { source, opened, times, overlay } = planned;
        let Opened { loader, project, .. } = opened;
        let scene = project.scene;
        let fingerprints = Fingerprints::new(&loader, &times, &scene, sizes.picture, None);
        let loader = loader.classified(classifier.clone());
        let source = source.display().to_string();
        let console = console.of(&source);
        let remarks = project.solid_files.remarks.into_iter();
        remarks.for_each(|remark| console.line(&remark));
        Self { source, loader, scene, times, overlay, fingerprints, console, last: None }
    }

    /// Draws its part of a picture, with its name.
    fn draw(
        &mut self,
        offscreen: &mut Offscreen,
        shot: &Shot,
        sizes: &Sizes,
        (camera_up, adapter): (Up, &str),
    ) -> limpid_io::Result<DynamicImage> {
        let at = self.times[shot.frame];
        let loaded = match self.last.take() {
            Some((time, loaded)) if time == at => loaded,
            _ => Arc::new(
                self.loader.load(at, &self.scene).map_err(|error| error.of_frame(at.frame))?,
            ),
        };
        let view = (&shot.camera, sizes.picture);
        self.console.frame(&loaded, &self.scene, view, camera_up, adapter);
        let scene = loaded.scene(&self.scene);
        let input = loaded.picture(&scene, &shot.camera, sizes.picture);
        let drawn = offscreen.draw(input)?;
        let mut picture = drawn.into_image();
        self.overlay.draw(&mut picture, &View::from(&shot.camera));
        let mut side = sizes.blank(sizes.side);
        side.copy_from(&picture, 0, 0).expect("it fits");
        overlay::name(&mut side, &self.source, sizes.dot);
        self.last = Some((at, loaded));
        Ok(side)
    }

    /// Says that its last frame is shown while others go on.
    fn tell_whether_held(&self) {
        let [.., before, last] = self.times.as_slice() else { return };
        let moves = self.times.iter().any(|time| time != last);
        if before == last && moves {
            self.console.line(&format!("ends before the others: its frame {} is held", last.frame));
        }
    }
}
