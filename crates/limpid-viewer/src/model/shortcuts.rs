//! Keyboard shortcuts: one table, which handles key presses and which `?` shows.

use eframe::egui::{Key, Modifiers};

use crate::model::platform::IN_BROWSER;

/// The action of a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Play or pause.
    Play,
    /// Play forwards or backwards.
    Reverse,
    /// Go to the next frame time.
    Next,
    /// Go to the previous frame time.
    Previous,
    /// Go to the first frame time.
    First,
    /// Go to the last frame time.
    Last,
    /// Loop or play once.
    Loop,
    /// Play faster.
    Faster,
    /// Play slower.
    Slower,
    /// Fit the view to the liquid.
    Fit,
    /// Go to the scene's own camera.
    Home,
    /// Look from the front.
    Front,
    /// Look from the right side.
    Side,
    /// Look from above.
    Top,
    /// Begin playback at this frame time, or where it begins otherwise.
    In,
    /// End playback at this frame time, or where it ends otherwise.
    Out,
    /// Take back the last change.
    Undo,
    /// Make it again.
    Redo,
    /// Add a key frame of the camera.
    AddKey,
    /// Show the next view mode.
    NextView,
    /// Show the picture, or the last view mode.
    Picture,
    /// Switch between one picture, wipe and side by side.
    Compare,
    /// Edit the other of the two settings.
    Swap,
    /// Open a file.
    Open,
    /// Save a picture.
    SavePicture,
    /// Save a film.
    SaveFilm,
    /// Save the scene.
    SaveScene,
    /// Copy the command line.
    Copy,
    /// Show or hide the panels.
    Panels,
    /// Switch between dark and light.
    Theme,
    /// Show the keys.
    Help,
    /// Close the list of keys and the notices.
    Close,
    /// Close the window.
    Quit,
}

/// A key and its action.
#[derive(Debug, Clone, Copy)]
pub struct Shortcut {
    /// Its action.
    pub action: Action,
    /// The key.
    pub key: Key,
    /// With Ctrl (⌘ on a Mac).
    pub command: bool,
    /// Its name in the interface.
    pub shown: &'static str,
    /// A description of the action.
    pub help: &'static str,
}

impl Shortcut {
    /// The help text with the key.
    pub(crate) fn tooltip(&self) -> String {
        format!("{} ({})", self.help, self.shown)
    }
}

const fn plain(action: Action, key: Key, shown: &'static str, help: &'static str) -> Shortcut {
    Shortcut { action, key, command: false, shown, help }
}

const fn with_command(
    action: Action,
    key: Key,
    shown: &'static str,
    help: &'static str,
) -> Shortcut {
    Shortcut { action, key, command: true, shown, help }
}

const FILM: &str = if IN_BROWSER {
    "how to save a film of what is played"
} else {
    "save a film of what is played"
};

const COPY: &str = if IN_BROWSER {
    "copy a link to this picture"
} else {
    "copy the command line of this picture"
};

/// All shortcuts, in display order.
pub const SHORTCUTS: [Shortcut; 33] = [
    plain(Action::Play, Key::Space, "Space", "play or pause"),
    plain(Action::Previous, Key::ArrowLeft, "Left", "previous frame"),
    plain(Action::Next, Key::ArrowRight, "Right", "next frame"),
    plain(Action::First, Key::Home, "Home", "first frame"),
    plain(Action::Last, Key::End, "End", "last frame"),
    plain(Action::Reverse, Key::R, "R", "play the other way"),
    plain(Action::Loop, Key::L, "L", "loop or play once"),
    plain(Action::In, Key::I, "I", "begin here when playing, or as before"),
    plain(Action::Out, Key::O, "O", "end here when playing, or as before"),
    plain(Action::Slower, Key::OpenBracket, "[", "slower"),
    plain(Action::Faster, Key::CloseBracket, "]", "faster"),
    plain(Action::Fit, Key::F, "F", "fit the view to the liquid"),
    plain(Action::Home, Key::H, "H", "the scene's own camera"),
    plain(Action::Front, Key::Num1, "1", "look from the front"),
    plain(Action::Side, Key::Num2, "2", "look from the side"),
    plain(Action::Top, Key::Num3, "3", "look from above"),
    plain(Action::AddKey, Key::K, "K", "add a key frame of the camera"),
    plain(Action::NextView, Key::V, "V", "the next view mode"),
    plain(Action::Picture, Key::P, "P", "the picture, or the view mode before"),
    plain(Action::Compare, Key::C, "C", "one picture, wipe, side by side"),
    plain(Action::Swap, Key::X, "X", "edit the other settings, A or B"),
    with_command(Action::Undo, Key::Z, "Ctrl Z", "take back the last change of settings"),
    with_command(Action::Redo, Key::Y, "Ctrl Y", "make it again"),
    with_command(Action::Open, Key::O, "Ctrl O", "open a file"),
    with_command(Action::SavePicture, Key::S, "Ctrl S", "save a picture"),
    with_command(Action::SaveFilm, Key::M, "Ctrl M", FILM),
    with_command(Action::SaveScene, Key::E, "Ctrl E", "save the scene"),
    with_command(Action::Copy, Key::L, "Ctrl L", COPY),
    plain(Action::Panels, Key::Tab, "Tab", "show or hide the panels"),
    plain(Action::Theme, Key::T, "T", "dark or light"),
    plain(Action::Help, Key::Questionmark, "?", "these keys"),
    plain(Action::Close, Key::Escape, "Esc", "close what is open"),
    with_command(Action::Quit, Key::Q, "Ctrl Q", "close the window"),
];

/// Actions of the pointer, for the same list.
pub const POINTER: [(&str, &str); 8] = [
    ("Drag", "orbit"),
    ("Shift drag, or middle button", "pan"),
    ("Wheel", "zoom to the pointer"),
    ("Right button", "look around; with W A S D Q E fly, with Shift faster"),
    ("Two fingers", "pan, and pinch to zoom"),
    ("Double click", "fit the view to the liquid"),
    ("Click", "the values of the particle"),
    ("Drop files", "open them"),
];

/// The shortcut of an action.
pub fn of(action: Action) -> &'static Shortcut {
    SHORTCUTS.iter().find(|s| s.action == action).unwrap_or(&SHORTCUTS[0])
}

/// The action of a key press.
pub fn action(key: Key, modifiers: Modifiers) -> Option<Action> {
    let plain = !(modifiers.command || modifiers.ctrl || modifiers.alt);
    let fits = |s: &&Shortcut| {
        let with = if s.command { modifiers.command && !modifiers.alt } else { plain };
        s.key == key && with
    };
    // `?` is Shift with a key that differs between keyboards.
    let help = key == Key::Slash && modifiers.shift && plain;
    let redo = key == Key::Z && modifiers.shift && modifiers.command && !modifiers.alt;
    if redo {
        return Some(Action::Redo);
    }
    let found = if help { Some(of(Action::Help)) } else { SHORTCUTS.iter().find(fits) };
    found.map(|s| s.action)
}
