//! The demos of the first screen, and their scene files.

/// A scene that comes with the program.
#[derive(Debug)]
pub struct Demo {
    /// File name without its extension.
    pub name: &'static str,
    /// Title.
    pub title: &'static str,
    /// Its description.
    pub about: &'static str,
    /// The scene file.
    pub(crate) scene: &'static str,
    /// A JPEG picture of it.
    pub(crate) picture: &'static [u8],
}

/// The demos, in display order.
pub static DEMOS: [Demo; 4] = [
    Demo {
        name: "dam_break",
        title: "Breaking dam",
        about: "simulated while it plays",
        scene: include_str!("../../demos/dam_break.toml"),
        picture: include_bytes!("../../demos/dam_break.jpg"),
    },
    Demo {
        name: "fountain",
        title: "Fountain",
        about: "simulated while it plays",
        scene: include_str!("../../demos/fountain.toml"),
        picture: include_bytes!("../../demos/fountain.jpg"),
    },
    Demo {
        name: "lagoon",
        title: "Lagoon",
        about: "bodies in and on clear water, in the sun",
        scene: limpid::sims::LAGOON,
        picture: include_bytes!("../../demos/lagoon.jpg"),
    },
    Demo {
        name: "vase",
        title: "Vase",
        about: "water in the shape of a vase, and its caustics",
        scene: limpid::sims::VASE,
        picture: include_bytes!("../../demos/vase.jpg"),
    },
];
