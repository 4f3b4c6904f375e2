//! Loading the frames of a cache.

use std::sync::Arc;

use crate::model::document::Document;
use limpid::scene::Scene;
use limpid_io::error::Result;
use limpid_io::input::{self, FrameTime, Loaded};
use limpid_io::shared_classifier::{Processor, SharedClassifier};

/// Source of a cache's frames.
#[derive(Debug)]
pub(crate) struct Loader {
    pub(crate) input: input::Loader,
    pub(crate) times: Arc<[FrameTime]>,
    /// The scene that particles are classified for.
    pub(crate) scene: Scene,
}

impl Loader {
    /// Frames of a document, which `classifier` classifies on a processor.
    pub(crate) fn new(
        document: &Document,
        times: Arc<[FrameTime]>,
        scene: Scene,
        (classifier, processor): (&SharedClassifier, Processor),
    ) -> Self {
        let input = document.input.clone().classified(classifier.clone());
        Self { input: input.processed_by(processor), times, scene }
    }

    /// Reads and classifies the frame of an index. Waiting for a device blocks a thread, and yields in a browser.
    ///
    /// # Errors
    /// As [`input::Loader::finish_load`].
    pub(crate) async fn load(&self, i: usize) -> Result<Loaded> {
        self.input.finish_load(self.times[i], &self.scene).await
    }
}
