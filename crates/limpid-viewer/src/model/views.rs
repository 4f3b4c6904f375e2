//! View modes: intermediate images as pictures, and their legends.

use eframe::egui::{Color32, ColorImage};
use glam::UVec2;

use limpid::aov::{Aov, Part};
use limpid::passes::tonemap::srgb_byte;

/// A view mode: the picture or another image of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum View {
    /// The picture.
    #[default]
    Picture,
    /// An intermediate image and the index of its layer in [`View::layers`].
    Image(Aov, usize),
}

/// The meaning of a picture's colours.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Legend {
    /// The picture itself.
    #[default]
    Picture,
    /// A quantity from low to high.
    Scale {
        /// The quantity.
        title: &'static str,
        /// Value at the lower end.
        low: f32,
        /// Value at the upper end.
        high: f32,
        /// Unit of both.
        unit: &'static str,
    },
    /// The components of a direction.
    Normal,
    /// Linear light, up to a white level.
    Light {
        /// The quantity.
        title: &'static str,
        /// The value shown as white.
        white: f32,
        /// Its unit.
        unit: &'static str,
    },
    /// The frame has no such image, for this reason.
    Nothing(&'static str),
}

/// The values behind a picture's colours.
#[derive(Debug, Clone, PartialEq)]
pub struct Values {
    /// Size in pixels.
    pub size: UVec2,
    /// One or three channels, in rows from the top.
    pub channels: Vec<Vec<f32>>,
}

impl Values {
    /// The values at a position in the picture, both coordinates from 0 to 1.
    pub fn at(&self, x: f32, y: f32) -> Option<Vec<f32>> {
        let column = (x * self.size.x as f32) as usize;
        let row = (y * self.size.y as f32) as usize;
        let inside = (0.0..1.0).contains(&x) && (0.0..1.0).contains(&y);
        let i = row * self.size.x as usize + column;
        self.channels.iter().map(|c| c.get(i).copied().filter(|_| inside)).collect()
    }
}

/// Colour of empty pixels.
const EMPTY: Color32 = Color32::from_gray(40);

impl View {
    /// All view modes, each with its first layer.
    pub fn all() -> impl Iterator<Item = Self> {
        let images = Aov::ALL.into_iter().filter(|aov| !aov.is_for_compositing());
        std::iter::once(Self::Picture).chain(images.map(|aov| Self::Image(aov, 0)))
    }

    /// The intermediate image that it shows.
    pub fn aov(self) -> Option<Aov> {
        match self {
            Self::Picture => None,
            Self::Image(aov, _) => Some(aov),
        }
    }

    /// Display name.
    pub fn label(self) -> &'static str {
        match self.aov() {
            None => "Picture",
            Some(Aov::Depth) => "Depth",
            Some(Aov::Normal) => "Normal",
            Some(Aov::Motion) => "Motion",
            Some(Aov::Coverage) => "Coverage",
            Some(Aov::Mask) => "Masks of fluids",
            Some(Aov::Diffuse) => "Foam",
            Some(Aov::Value) => "Value",
            Some(Aov::SmoothDepth) => "Smoothed depth",
            Some(Aov::SmoothNormal) => "Smoothed normal",
            Some(Aov::SolidDepth) => "Depth of solids",
            Some(Aov::Radiance) => "Radiance",
            Some(Aov::Interfaces) => "Interfaces",
            Some(Aov::Inside) => "Length inside",
            Some(Aov::Iterations) => "Iterations",
            Some(Aov::Failures) => "Failures",
            Some(Aov::Caustics) => "Caustic map",
        }
    }

    /// Names of its layers, or for each light, of its irradiance and its depth.
    pub fn layers(self, lights: usize) -> Vec<String> {
        let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        match self.aov() {
            Some(Aov::Depth | Aov::Normal) => {
                names(&["aggregate front", "aggregate back", "splash front", "splash back"])
            }
            Some(Aov::SmoothDepth | Aov::SmoothNormal) => {
                names(&["aggregate front", "aggregate back"])
            }
            Some(Aov::Caustics) => (1..=lights)
                .flat_map(|n| [format!("light {n}"), format!("light {n}, depth")])
                .collect(),
            _ => Vec::new(),
        }
    }

    /// Names of its part of the images from [`limpid::aov::read`], and of the part's channels.
    fn channels(self) -> (String, Vec<String>) {
        let Self::Image(aov, layer) = self else { return Default::default() };
        let classes = ["aggregate_front", "aggregate_back", "splash_front", "splash_back"];
        let class = classes[layer.min(3)];
        let three =
            |name: &str, axes: [&str; 3]| axes.map(|axis| format!("{name}.{axis}")).to_vec();
        let (part, channels) = match aov {
            Aov::Depth | Aov::SmoothDepth => ("limpid".to_owned(), vec![format!("{aov}.{class}")]),
            Aov::Normal | Aov::SmoothNormal => {
                ("limpid".to_owned(), three(&format!("{aov}.{class}"), ["X", "Y", "Z"]))
            }
            Aov::Diffuse => ("limpid".to_owned(), vec!["diffuse.coverage".to_owned()]),
            Aov::Radiance => ("limpid".to_owned(), three("radiance", ["R", "G", "B"])),
            Aov::Caustics => {
                let channels = match layer % 2 {
                    0 => three("irradiance", ["R", "G", "B"]),
                    _ => vec!["receiver_depth".to_owned()],
                };
                (format!("caustics.{}", layer / 2 + 1), channels)
            }
            _ => ("limpid".to_owned(), vec![aov.to_string()]),
        };
        (part, channels)
    }

    /// The image as a picture with its legend; an empty picture of `size` if it is not in `parts`.
    pub fn shown(self, parts: &[Part], size: UVec2) -> (ColorImage, Legend, Option<Values>) {
        let (name, channel_names) = self.channels();
        let part = parts.iter().find(|part| part.name == name);
        let channels = part.and_then(|part| {
            let find = |name: &String| part.channels.iter().find(|c| c.name == *name);
            channel_names
                .iter()
                .map(|name| Some(find(name)?.values.clone()))
                .collect::<Option<Vec<_>>>()
        });
        let (Some(part), Some(channels)) = (part, channels.filter(|c| !c.is_empty())) else {
            let empty = ColorImage::filled([size.x as usize, size.y as usize], EMPTY);
            return (empty, Legend::Nothing(self.nothing()), None);
        };
        let (pixels, legend) = match channels.as_slice() {
            [values] => self.scale(values),
            [x, y, z, ..] => match self.aov() {
                Some(Aov::Radiance) => light(x, y, z, 1.0, "Radiance", ""),
                Some(Aov::Caustics) => {
                    let white = [x, y, z].map(|c| percentile(c, 0.995)).into_iter();
                    let white = white.fold(f32::MIN_POSITIVE, f32::max);
                    light(x, y, z, white, "Irradiance", "W/m²")
                }
                _ => (normals(x, y, z), Legend::Normal),
            },
            _ => unreachable!("an image has one or three channels"),
        };
        let image = ColorImage::new([part.size.x as usize, part.size.y as usize], pixels);
        (image, legend, Some(Values { size: part.size, channels }))
    }

    fn nothing(self) -> &'static str {
        match self {
            Self::Image(Aov::Caustics, _) => "No light reaches a lit solid.",
            Self::Image(Aov::SolidDepth, _) => "The scene has no solids.",
            Self::Image(Aov::Depth | Aov::Normal, 2..) => "This frame has no splashes.",
            _ => "This frame has none.",
        }
    }

    /// Maps one value per pixel to the colours of [`viridis`].
    fn scale(self, values: &[f32]) -> (Vec<Color32>, Legend) {
        // A depth of 0 is empty; a count or length of 0 is a value.
        let (title, unit, depth, whole) = match self.aov() {
            Some(Aov::Interfaces) => ("Interfaces", "", false, true),
            Some(Aov::Inside) => ("Length inside", "m", false, false),
            Some(Aov::Iterations) => ("Layer evaluations", "", false, true),
            Some(Aov::Failures) => ("Failures", "", false, true),
            Some(Aov::Value) => ("Value", "", true, false),
            _ => ("Depth", "m", true, false),
        };
        let (low, high) = if depth {
            let full: Vec<f32> = values.iter().copied().filter(|&v| v > 0.0).collect();
            (percentile(&full, 0.005), percentile(&full, 0.98))
        } else if whole {
            (0.0, values.iter().copied().fold(1.0, f32::max))
        } else {
            (0.0, percentile(values, 0.995))
        };
        let high = if high > low { high } else { low + low.abs().max(1e-6) };
        let color = |&value: &f32| match depth && value <= 0.0 {
            true => EMPTY,
            false => viridis((value - low) / (high - low)),
        };
        (values.iter().map(color).collect(), Legend::Scale { title, low, high, unit })
    }
}

/// Maps directions to colours: each component from −1 to 1 becomes 0 to 255.
fn normals(x: &[f32], y: &[f32], z: &[f32]) -> Vec<Color32> {
    let byte = |c: f32| (127.5 * (c + 1.0)).round() as u8;
    let pixels = x.iter().zip(y).zip(z);
    pixels
        .map(|((&x, &y), &z)| match x == 0.0 && y == 0.0 && z == 0.0 {
            true => EMPTY,
            false => Color32::from_rgb(byte(x), byte(y), byte(z)),
        })
        .collect()
}

fn light(
    r: &[f32],
    g: &[f32],
    b: &[f32],
    white: f32,
    title: &'static str,
    unit: &'static str,
) -> (Vec<Color32>, Legend) {
    let byte = |c: f32| srgb_byte(f64::from(c / white));
    let pixels = r.iter().zip(g).zip(b);
    let pixels = pixels.map(|((&r, &g), &b)| Color32::from_rgb(byte(r), byte(g), byte(b)));
    (pixels.collect(), Legend::Light { title, white, unit })
}

/// The value that this share of all values does not exceed; 0 if there are none.
fn percentile(values: &[f32], share: f32) -> f32 {
    // A subset is enough for a percentile of a picture.
    let every = (values.len() / 20_000).max(1);
    let mut some: Vec<f32> = values.iter().copied().step_by(every).collect();
    if some.is_empty() {
        return 0.0;
    }
    let at = ((some.len() - 1) as f32 * share).round() as usize;
    *some.select_nth_unstable_by(at, f32::total_cmp).1
}

/// A perceptually uniform colour map from dark blue over green to yellow: nine points of the map of van
/// der Walt and Smith (2015).
pub fn viridis(t: f32) -> Color32 {
    const POINTS: [[f32; 3]; 9] = [
        [68.0, 1.0, 84.0],
        [71.0, 44.0, 122.0],
        [59.0, 81.0, 139.0],
        [44.0, 113.0, 142.0],
        [33.0, 144.0, 141.0],
        [39.0, 173.0, 129.0],
        [92.0, 200.0, 99.0],
        [170.0, 220.0, 50.0],
        [253.0, 231.0, 37.0],
    ];
    let at = 8.0 * if t.is_finite() { t.clamp(0.0, 1.0) } else { 0.0 };
    let i = (at as usize).min(7);
    let mix = |c: usize| {
        let (a, b) = (POINTS[i][c], POINTS[i + 1][c]);
        (a + (at - i as f32) * (b - a)).round() as u8
    };
    Color32::from_rgb(mix(0), mix(1), mix(2))
}
