//! Settings A and B, and how they are compared.

use limpid::scene::Scene;

/// How settings A and B are compared on screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Compare {
    /// Only the settings being edited.
    #[default]
    Off,
    /// A on the left of a line, B on its right.
    Wipe,
    /// A and B, each in half of the window.
    SideBySide,
}

impl Compare {
    pub(crate) const ALL: [Self; 3] = [Self::Off, Self::Wipe, Self::SideBySide];

    pub(crate) fn label(self) -> &'static str {
        match self {
            Self::Off => "Off",
            Self::Wipe => "Wipe",
            Self::SideBySide => "Side by side",
        }
    }

    /// The mode after this one.
    pub(crate) fn next(self) -> Self {
        let at = Self::ALL.iter().position(|&compare| compare == self).unwrap_or(0);
        Self::ALL[(at + 1) % Self::ALL.len()]
    }
}

/// Settings A and B, as scenes.
#[derive(Debug)]
pub(crate) struct Editing {
    /// Settings A and B.
    pub(crate) scenes: [Scene; 2],
    /// Index of the one that the panels change.
    pub(crate) edited: usize,
    pub(crate) compare: Compare,
    /// Place of the line between A and B, 0 at the left of the picture to 1 at its right.
    pub(crate) wipe: f32,
}

impl Editing {
    /// Both as in one scene.
    pub(crate) fn new(scene: Scene) -> Self {
        Self { scenes: [scene.clone(), scene], edited: 0, compare: Compare::Off, wipe: 0.5 }
    }

    /// The scene that is edited.
    pub(crate) fn scene(&self) -> &Scene {
        &self.scenes[self.edited]
    }

    /// Indices of the settings on screen.
    pub(crate) fn visible(&self) -> Vec<usize> {
        if self.compare == Compare::Off { vec![self.edited] } else { vec![0, 1] }
    }
}
