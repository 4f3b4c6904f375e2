//! The viewer's state, grouped by the component that changes it.

use std::collections::BTreeSet;
use std::sync::{Arc, mpsc};
#[cfg(not(target_arch = "wasm32"))]
use std::thread::JoinHandle;
use web_time::Instant;

use eframe::egui;
use glam::UVec2;
use limpid::camera::Camera;
use limpid::scene::Scene;
use limpid_io::camera_path::CameraPath;
use limpid_io::input::FrameTime;
#[cfg(not(target_arch = "wasm32"))]
use limpid_io::shared_classifier::SharedClassifier;

#[cfg(not(target_arch = "wasm32"))]
use crate::app::filming::Filming;
use crate::app::log::Log;
use crate::app::opening::Opening;
use crate::app::recent::Recent;
use crate::backend::core::messages::{Message, Post};
use crate::backend::frames::Frames;
#[cfg(not(target_arch = "wasm32"))]
use crate::backend::native::draw_thread::DrawThread;
use crate::model::document::Document;
use crate::model::level::Level;
use crate::model::views::View;
use crate::panels::dialogs::Dialog;
use crate::picture::adaptive_resolution::AdaptiveResolution;
use crate::picture::refine::{Side, Subject};
use crate::{Compare, Notice, Tab};

/// Threads, and the messages from them. Any part of the interface starts jobs; messages end them.
pub(crate) struct Jobs {
    pub(crate) post: Post,
    pub(crate) messages: mpsc::Receiver<Message>,
    pub(crate) log: Log,
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) drawing: DrawThread,
    /// In a browser a worker does all that threads do elsewhere.
    #[cfg(target_arch = "wasm32")]
    pub(crate) drawing: crate::backend::web::Worker,
    /// The classifier of the particles.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) classifier: SharedClassifier,
    /// Whether the draw thread has been asked to open a device for them.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) device_asked: bool,
    /// The film that is being written.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) filming: Option<Filming>,
    /// Threads that write files.
    #[cfg(not(target_arch = "wasm32"))]
    pub(crate) writers: Vec<JoinHandle<()>>,
    pub(crate) adapter: Option<String>,
}

/// The open document and its frames. Opening and growing simulations change it.
pub(crate) struct OpenDocument {
    pub(crate) document: Option<Arc<Document>>,
    pub(crate) opening: Option<Opening>,
    /// The previous opening while another source is being opened.
    pub(crate) before: Option<Opening>,
    /// Number of openings so far.
    pub(crate) openings: u64,
    pub(crate) frame_times: Arc<[FrameTime]>,
    pub(crate) frames: Frames,
    pub(crate) failed: BTreeSet<usize>,
}

/// Settings A and B, as scenes, and the particles of each. The settings panel changes the scenes.
pub(crate) struct Editing {
    /// Settings A and B, as scenes.
    pub(crate) scenes: [Scene; 2],
    pub(crate) edited: usize,
    pub(crate) compare: Compare,
    pub(crate) wipe: f32,
    pub(crate) sides: [Side; 2],
}

/// The camera and its path. Camera controls and the camera panel change it.
pub(crate) struct CameraState {
    pub(crate) camera: Camera,
    pub(crate) path: CameraPath,
    pub(crate) follow: bool,
    pub(crate) path_seconds: f64,
}

/// The view mode and the requests to the draw thread. The refinement changes it.
pub(crate) struct PictureState {
    pub(crate) dragging: bool,
    pub(crate) view: View,
    pub(crate) view_before: View,
    pub(crate) refine: bool,
    pub(crate) resolution: AdaptiveResolution,
    pub(crate) subject: Option<Subject>,
    pub(crate) changed: Instant,
    pub(crate) asked: u64,
    pub(crate) asked_level: Level,
    pub(crate) answered: u64,
    /// The last requested picture could not be drawn.
    pub(crate) undrawn: bool,
    /// The device has not drawn a picture yet: the first takes longer.
    pub(crate) fresh_device: bool,
    pub(crate) viewport_size: UVec2,
}

/// The state of panels, dialogs and notices.
pub(crate) struct Interface {
    pub(crate) notices: Vec<Notice>,
    pub(crate) tab: Tab,
    pub(crate) panels: bool,
    pub(crate) help: bool,
    pub(crate) dialog: Option<Dialog>,
    pub(crate) browsing: bool,
    pub(crate) recent: Recent,
    /// The demos' pictures, once they have been shown.
    pub(crate) demos: Vec<egui::TextureHandle>,
    pub(crate) dark: bool,
    /// Only the picture and the timeline are shown: within a page of somebody else.
    pub(crate) plain: bool,
    pub(crate) ticked: Instant,
}
