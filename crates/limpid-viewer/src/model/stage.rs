//! View of the open document: settings, camera and moment.

use std::sync::Arc;

use crate::model::coloring::Coloring;
use crate::model::editing::Editing;
use crate::model::eye::Eye;
use crate::model::playback::Playback;
use limpid::liquid::Up;
use limpid_io::input::FrameTime;
use limpid_io::shared_classifier::Processor;

/// View of the open document.
#[derive(Debug)]
pub(crate) struct Stage {
    pub(crate) editing: Editing,
    pub(crate) eye: Eye,
    /// The axis of the files that points up.
    pub(crate) up: Up,
    pub(crate) playback: Playback,
    /// The frame times of playback.
    pub(crate) frame_times: Arc<[FrameTime]>,
    /// The processor that classifies the particles.
    pub(crate) processor: Processor,
    /// The colours of the particles.
    pub(crate) colors: Coloring,
}

impl Stage {
    /// The current frame time.
    pub(crate) fn frame_time(&self) -> Option<FrameTime> {
        self.frame_times.get(self.playback.index()).copied()
    }
}
