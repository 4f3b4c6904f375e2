//! The panels around the picture. Each shows the state that it is given, may change some of it, and lists the user's
//! other wishes as `Command`s.

mod camera;
mod colors;
mod data;
pub(crate) mod dialogs;
pub(crate) mod error_plot;
pub(crate) mod first_screen;
mod icons;
mod layout;
mod liquid;
pub(crate) mod notices;
pub(crate) mod scene;
pub(crate) mod settings;
pub(crate) mod side;
mod sliders;
pub(crate) mod style;
pub(crate) mod timeline;
pub(crate) mod times;
pub(crate) mod toolbar;

pub(crate) use camera::camera_panel;
use limpid_io::adjustments::Adjustments;
use limpid_io::camera_path::Key;
use limpid_io::color_by::{Attribute, MapName};
use limpid_io::particles::Selection;

use crate::model::demos::Demo;
use crate::model::document::Source;
use crate::model::playback::Speed;
use crate::model::shortcuts::Action;
use crate::model::views::View;

/// Command of the user.
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "few of them exist at a time")]
pub(crate) enum Command {
    /// The action of a button.
    Act(Action),
    Open(Source),
    OpenDemo(&'static Demo),
    /// Opens the current source again, with other adjustments.
    Adjust(Adjustments),
    /// Opens the current source again, with another particle radius, m, or without a given one.
    SetRadius(Option<f32>),
    /// Opens the current source again, with these of its particles.
    Select(Selection),
    /// Chooses a folder to open.
    OpenFolder,
    /// Turns the sun, without opening the source again.
    TurnSun(Adjustments),
    /// Colours the particles by an attribute, or as they were opened.
    ColorBy(Option<Attribute>),
    /// Shows values by another map, over a range or the usual one.
    Recolor(MapName, Option<[f32; 2]>),
    /// Lists the attributes of the files.
    ListAttributes,
    SetSpeed(Speed),
    SetView(View),
    /// Goes to the frame of an index.
    Seek(usize),
    /// Goes to the camera and the time of a key.
    GoTo(Key),
    LoadPath,
    SavePath,
    StopFilm,
    /// Ends the simulation of the open document, which keeps its frames.
    StopSimulation,
    /// Shows the log of notices.
    ShowMessages,
    /// Traces the ground truth of the view.
    Trace,
}
