//! Opening a source, and making its frames if it is simulated.

use std::path::Path;

use crate::backend::core::messages::Message;
use crate::model::document::{Document, Source};
use limpid_io::bake::Progress;
use limpid_io::error::Result;
use limpid_io::project::Project;

/// The reports of an opening: its document, as soon as that can be opened, and how far its frames are made.
#[derive(Debug)]
pub struct Reports<O, R> {
    number: u64,
    /// Whether the document has been reported.
    open: bool,
    document: O,
    report: R,
}

impl<O: FnMut() -> Result<Document>, R: FnMut(Message)> Reports<O, R> {
    /// Reports the document if it can be opened, and if this is the `last` attempt also that it cannot.
    pub(crate) fn attempt(&mut self, last: bool) {
        if self.open {
            return;
        }
        let document = (self.document)();
        if document.is_ok() || last {
            self.open = true;
            (self.report)(Message::Opened(self.number, Box::new(document)));
        }
    }

    /// Reports that a frame has been made.
    pub(crate) fn progressed(&mut self, progress: Progress) {
        // The requested frames may be the last to be made.
        self.attempt(progress.done == progress.frames);
        (self.report)(Message::Baked(self.number, progress));
    }

    fn failed(&mut self, error: limpid_io::Error) {
        (self.report)(match self.open {
            true => Message::NotBaked(self.number, error),
            false => Message::Opened(self.number, Box::new(Err(error))),
        });
    }
}

/// Opens the source of an opening by `document`, and reports it. `bake` makes the frames of a simulation and says how
/// far it is.
pub(crate) async fn open<O: FnMut() -> Result<Document>, R: FnMut(Message)>(
    number: u64,
    source: &Source,
    document: O,
    report: R,
    bake: impl AsyncFnOnce(Project, &mut Reports<O, R>) -> Result<()>,
) {
    let mut reports = Reports { number, open: false, document, report };
    let Some(project) = simulated(source) else { return reports.attempt(true) };
    if let Err(error) = bake(project, &mut reports).await {
        reports.failed(error);
    }
}

/// The project of a simulated source; `None` for all others, and for unreadable ones, whose error is
/// reported by opening them.
fn simulated(source: &Source) -> Option<Project> {
    let path = Path::new(&source.input);
    let scene = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let project = scene.then(|| Project::load(path).ok()).flatten()?;
    project.source.simulation().is_some().then_some(project)
}

#[cfg(test)]
mod tests {
    use super::*;
    use limpid_io::Error;

    /// Runs these steps of an opening whose document cannot be opened, and returns its reports.
    fn reported(
        steps: impl FnOnce(&mut Reports<fn() -> Result<Document>, &mut dyn FnMut(Message)>),
    ) -> Vec<String> {
        let mut all = Vec::new();
        let mut report = |message| {
            all.push(match message {
                Message::Opened(1, document) if document.is_err() => "not opened".to_owned(),
                Message::Baked(1, progress) => format!("{} baked", progress.done),
                Message::NotBaked(1, _) => "not baked".to_owned(),
                other => format!("{other:?}"),
            });
        };
        let document: fn() -> Result<Document> = || Err(Error::Usage("it is missing".into()));
        steps(&mut Reports { number: 1, open: false, document, report: &mut report });
        all
    }

    fn made(done: u32) -> Progress {
        Progress { done, frames: 2, again: false }
    }

    /// A document that cannot be opened is reported once, after the last frame; an error before that is reported in its
    /// place, and an error after it as one of the simulation.
    #[test]
    fn every_opening_is_reported_once() {
        let missing = reported(|reports| {
            reports.attempt(false);
            reports.progressed(made(1));
            reports.progressed(made(2));
            reports.failed(Error::Usage("it fails".into()));
        });
        assert_eq!(missing, ["1 baked", "not opened", "2 baked", "not baked"]);
        let failed = reported(|reports| {
            reports.progressed(made(1));
            reports.failed(Error::Usage("it fails".into()));
        });
        assert_eq!(failed, ["1 baked", "not opened"]);
    }
}
