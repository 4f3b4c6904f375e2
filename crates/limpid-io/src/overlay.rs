//! Overlays of finished pictures, on request: a legend, a scale bar, the axes, names. They are drawn on the host, in
//! sRGB; but for the legend, with letters of 8×8 dots that are as large as the picture needs.

mod legend;
mod text;

use font8x8::{BASIC_FONTS, GREEK_FONTS, LATIN_FONTS, UnicodeFonts as _};
use glam::{DVec2, DVec3, UVec2};
use image::{DynamicImage, GenericImage as _, GenericImageView as _, Rgba};
use limpid::camera::View;
use limpid::liquid::Up;

use crate::color_by::ColorScale;

pub use legend::{alone as legend_alone, draw as draw_legend, fits as legend_fits};

/// Figures that are drawn over the pictures of a run.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Overlay {
    /// The place of whose depth a scale bar shows the scale, m.
    pub scale_bar: Option<DVec3>,
    /// The axis of the files that points up, if their axes are drawn.
    pub axes: Option<Up>,
    /// The colours that stand for values, if they get a legend.
    pub legend: Option<ColorScale>,
}

/// Pixels of one dot of a letter, in a picture of this size.
pub fn dot(size: UVec2) -> u32 {
    (size.min_element() / 320).max(1)
}

/// Height of a line of letters with the space around them, pixels.
pub fn line_height(size: UVec2) -> u32 {
    12 * dot(size)
}

impl Overlay {
    /// Draws over a picture that shows `view`. A picture too small for a part is left without it.
    pub fn draw(&self, picture: &mut DynamicImage, view: &View) {
        let size = UVec2::from(picture.dimensions());
        if let Some(place) = self.scale_bar {
            let depth = (place - view.eye).dot(view.ahead());
            scale_bar(picture, view.pixel_side(size, depth));
        }
        if let Some(up) = self.axes {
            // Of the files: they were turned when they were read.
            let [x, y, z] = match up {
                Up::Y => [DVec3::X, DVec3::Y, DVec3::Z],
                Up::Z => [DVec3::X, DVec3::NEG_Z, DVec3::Y],
            };
            axes(picture, [x, y, z].map(|axis| view.view_from_world * axis));
        }
        if let Some(scale) = &self.legend {
            legend::draw(picture, scale);
        }
    }
}

/// Writes a name in the middle of the last [line](line_height) of a picture, from the left on if it is too long: then its
/// end is shown.
pub fn name(picture: &mut DynamicImage, name: &str, dot: u32) {
    let size = UVec2::from(picture.dimensions()).as_dvec2();
    let most = (size.x / f64::from(8 * dot)).floor().max(0.0) as usize;
    let letters: Vec<char> = name.chars().collect();
    let cut = letters.len().saturating_sub(most);
    let shown: String = letters[cut..].iter().collect();
    let mut ink = Ink::new(UVec2::from(picture.dimensions()), dot);
    let at = DVec2::new(0.5 * (size.x - ink.width(&shown)), size.y - f64::from(10 * dot));
    ink.text(&shown, at);
    ink.apply(picture, WHITE);
}

const WHITE: [u8; 3] = [255; 3];

/// The largest round length below this one: 1, 2 or 5 times a power of ten, m.
fn round_below(length: f64) -> f64 {
    let decade = 10f64.powf(length.log10().floor());
    let steps = [5.0, 2.0, 1.0].map(|step| step * decade);
    steps.into_iter().find(|&step| step <= length * (1.0 + 1e-9)).unwrap_or(decade)
}

/// A length with its unit: `200 m`, `5 mm`.
fn with_unit(length: f64) -> String {
    let (unit, name) = match length {
        1e3..1e9 => (1e3, "km"),
        0.1..1e3 => (1.0, "m"),
        1e-3..0.1 => (1e-3, "mm"),
        1e-7..1e-3 => (1e-6, "µm"),
        _ => return format!("{length:e} m"),
    };
    // Without the digits of a product that is not exact.
    let number = (length / unit * 1e3).round() / 1e3;
    format!("{number} {name}")
}

/// Draws a bar of a round length, no longer than a quarter of the picture, in its lower left corner; `pixel` is the side
/// of a pixel, m.
fn scale_bar(picture: &mut DynamicImage, pixel: f64) {
    let size = UVec2::from(picture.dimensions());
    let length = round_below(0.25 * f64::from(size.x) * pixel);
    if !(pixel > 0.0 && length.is_normal()) {
        return;
    }
    let text = with_unit(length);
    let mut ink = Ink::new(size, dot(size));
    let (dot, long) = (f64::from(ink.dot), length / pixel);
    // A line of one dot fills its row of dots where it lies in its middle.
    let (left, y) = (4.5 * dot, f64::from(size.y) - 5.5 * dot);
    if ink.width(&text).max(long) + 2.0 * left > f64::from(size.x) || y < 14.0 * dot {
        return;
    }
    ink.line(DVec2::new(left, y), DVec2::new(left + long, y), dot);
    for x in [left, left + long] {
        ink.line(DVec2::new(x, y - 1.5 * dot), DVec2::new(x, y + 1.5 * dot), dot);
    }
    let start = (left + 0.5 * (long - ink.width(&text))).max(left);
    ink.text(&text, DVec2::new(start, y - 11.0 * dot));
    ink.apply(picture, WHITE);
}

/// Draws axes, unit vectors in view space, in the lower right corner: those that point away first.
fn axes(picture: &mut DynamicImage, directions: [DVec3; 3]) {
    const COLORS: [[u8; 3]; 3] = [[255, 96, 80], [112, 220, 96], [112, 160, 255]];
    const NAMES: [&str; 3] = ["x", "y", "z"];
    let size = UVec2::from(picture.dimensions());
    let dot = dot(size);
    let (unit, long) = (f64::from(dot), 20.0 * f64::from(dot));
    let middle = size.as_dvec2() - 32.0 * unit;
    if middle.min_element() < 32.0 * unit {
        return;
    }
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| directions[a].z.total_cmp(&directions[b].z));
    for axis in order {
        let across = DVec2::new(directions[axis].x, -directions[axis].y);
        let mut ink = Ink::new(size, dot);
        ink.line(middle, middle + long * across, 1.5 * unit);
        // Beside the tip, or beside the middle of an axis that is seen from its end.
        let beside = across.normalize_or(DVec2::new(-1.0, -1.0).normalize());
        let tip = middle + long * across + 6.0 * unit * beside;
        ink.text(NAMES[axis], tip - 4.0 * unit);
        ink.apply(picture, COLORS[axis]);
    }
}

/// Shapes of one colour, before they are drawn over a picture.
struct Ink {
    size: UVec2,
    /// Pixels of a letter's dot.
    dot: u32,
    /// How far each pixel is covered, 0 to 1.
    cover: Vec<f32>,
}

impl Ink {
    fn new(size: UVec2, dot: u32) -> Self {
        Self { size, dot, cover: vec![0.0; size.x as usize * size.y as usize] }
    }

    /// Width of a text, pixels.
    fn width(&self, text: &str) -> f64 {
        f64::from(8 * self.dot) * text.chars().count() as f64
    }

    fn cover(&mut self, x: i64, y: i64, share: f64) {
        let inside = |at: i64, size: u32| (0..i64::from(size)).contains(&at);
        if inside(x, self.size.x) && inside(y, self.size.y) {
            let pixel = &mut self.cover[y as usize * self.size.x as usize + x as usize];
            *pixel = pixel.max(share as f32);
        }
    }

    /// Adds a text whose first letter's upper left corner is at a place.
    fn text(&mut self, text: &str, at: DVec2) {
        let dot = i64::from(self.dot);
        let (left, top) = (at.x.round() as i64, at.y.round() as i64);
        for (i, letter) in (0..).zip(text.chars()) {
            let known = BASIC_FONTS.get(letter).or_else(|| LATIN_FONTS.get(letter));
            let known = known.or_else(|| GREEK_FONTS.get(letter)).or_else(|| BASIC_FONTS.get('?'));
            for (row, bits) in (0..).zip(known.unwrap_or_default()) {
                for column in (0..8).filter(|column| bits >> column & 1 == 1) {
                    let (x, y) = (left + dot * (8 * i + column), top + dot * row);
                    for (dx, dy) in (0..dot).flat_map(|dy| (0..dot).map(move |dx| (dx, dy))) {
                        self.cover(x + dx, y + dy, 1.0);
                    }
                }
            }
        }
    }

    /// Adds a line of this width, with round ends.
    fn line(&mut self, from: DVec2, to: DVec2, width: f64) {
        let (along, reach) = (to - from, DVec2::splat(0.5 * width + 1.0));
        let (low, high) = (from.min(to) - reach, from.max(to) + reach);
        let squared = along.length_squared().max(1e-12);
        for y in low.y.floor() as i64..=high.y.ceil() as i64 {
            for x in low.x.floor() as i64..=high.x.ceil() as i64 {
                let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let share = ((at - from).dot(along) / squared).clamp(0.0, 1.0);
                let distance = at.distance(from + share * along);
                self.cover(x, y, (0.5 * width + 0.5 - distance).clamp(0.0, 1.0));
            }
        }
    }

    /// Draws it in a colour, on a dark rim of one dot, so that it shows on any picture.
    fn apply(&self, picture: &mut DynamicImage, color: [u8; 3]) {
        const RIM: f32 = 0.6;
        let (wide, dot) = (self.size.x as usize, self.dot as usize);
        let mut rim = vec![0.0f32; self.cover.len()];
        for (i, &cover) in self.cover.iter().enumerate().filter(|(_, cover)| **cover > 0.0) {
            let (x, y) = (i % wide, i / wide);
            let rows = y.saturating_sub(dot)..=(y + dot).min(self.size.y as usize - 1);
            for row in rows {
                for pixel in &mut rim
                    [row * wide + x.saturating_sub(dot)..=row * wide + (x + dot).min(wide - 1)]
                {
                    *pixel = pixel.max(RIM * cover);
                }
            }
        }
        for (i, &rim) in rim.iter().enumerate().filter(|(_, rim)| **rim > 0.0) {
            let (x, y) = ((i % wide) as u32, (i / wide) as u32);
            picture.put_pixel(x, y, over(picture.get_pixel(x, y), [0; 3], rim));
        }
        self.stain(picture, color);
    }

    /// Draws it in a colour.
    fn stain(&self, picture: &mut DynamicImage, color: [u8; 3]) {
        let wide = self.size.x as usize;
        for (i, &cover) in self.cover.iter().enumerate().filter(|(_, cover)| **cover > 0.0) {
            let (x, y) = ((i % wide) as u32, (i / wide) as u32);
            picture.put_pixel(x, y, over(picture.get_pixel(x, y), color, cover));
        }
    }
}

/// A colour over a pixel whose alpha is not multiplied into its colour.
fn over(Rgba([r, g, b, a]): Rgba<u8>, color: [u8; 3], share: f32) -> Rgba<u8> {
    let behind = (1.0 - share) * f32::from(a) / 255.0;
    let alpha = share + behind;
    if alpha <= 0.0 {
        return Rgba([r, g, b, a]);
    }
    let mix = |front: u8, back: u8| {
        ((share * f32::from(front) + behind * f32::from(back)) / alpha).round() as u8
    };
    let [red, green, blue] = color;
    Rgba([mix(red, r), mix(green, g), mix(blue, b), (255.0 * alpha).round() as u8])
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use image::{Rgb, RgbImage, RgbaImage};
    use limpid::camera::{Camera, Lens};

    fn grey(size: UVec2) -> DynamicImage {
        RgbImage::from_pixel(size.x, size.y, Rgb([90; 3])).into()
    }

    /// Columns of the lowest row that has the colour, from left to right.
    fn bar(picture: &DynamicImage, color: [u8; 3]) -> Vec<u32> {
        let is = |x, y| picture.get_pixel(x, y).0[..3] == color;
        let row = (0..picture.height())
            .rev()
            .max_by_key(|&y| (0..picture.width()).filter(|&x| is(x, y)).count());
        (0..picture.width()).filter(|&x| is(x, row.unwrap_or(0))).collect()
    }

    /// Round lengths are 1, 2 and 5 times powers of ten, with their units.
    #[test]
    fn lengths_are_round() {
        for (length, round, text) in [
            (0.26, 0.2, "0.2 m"),
            (1.0, 1.0, "1 m"),
            (0.999, 0.5, "0.5 m"),
            (0.07, 0.05, "50 mm"),
            (0.0049, 0.002, "2 mm"),
            (3e-4, 2e-4, "200 µm"),
            (4700.0, 2000.0, "2 km"),
            (650.0, 500.0, "500 m"),
            (5e-10, 5e-10, "5e-10 m"),
        ] {
            let found = round_below(length);
            assert!((found / round - 1.0).abs() < 1e-9, "{length}: {found}");
            assert_eq!(with_unit(found), text);
        }
    }

    /// A bar is as long in the picture as its length is at the place, in a perspective view and in a parallel one, and
    /// farther away it is shorter or rounder.
    #[test]
    fn scale_bars_have_the_length_of_their_text() {
        let size = UVec2::new(800, 600);
        let camera = |eye: f64, lens| Camera {
            eye: eye * DVec3::Z,
            target: DVec3::ZERO,
            up: Vec3::Y,
            fov_y: 40.0,
            near: None,
            lens,
        };
        for (camera, place, round) in [
            (camera(10.0, None), DVec3::ZERO, 2.0),
            (camera(10.0, None), 5.0 * DVec3::Z, 1.0),
            (camera(1e3, None), DVec3::ZERO, 200.0),
            (camera(10.0, Some(Lens::Orthographic { height: 3.0 })), DVec3::ZERO, 1.0),
            (camera(70.0, Some(Lens::Orthographic { height: 3.0 })), DVec3::ZERO, 1.0),
        ] {
            let view = View::from(&camera);
            let mut picture = grey(size);
            Overlay { scale_bar: Some(place), ..Overlay::default() }.draw(&mut picture, &view);
            let columns = bar(&picture, WHITE);
            let wide = f64::from(columns[columns.len() - 1] - columns[0] + 1);
            let pixel = view.pixel_side(size, (place - view.eye).dot(view.ahead()));
            assert!((wide - round / pixel).abs() < 4.0, "{wide} pixels, not {}", round / pixel);
        }
    }

    /// Axes are those of the files: files that were turned have their z upward. They lie in the picture whatever its size,
    /// or are left out.
    #[test]
    fn axes_are_those_of_the_files() {
        let camera = Camera {
            eye: DVec3::new(0.0, 0.0, 5.0),
            target: DVec3::ZERO,
            up: Vec3::Y,
            fov_y: 40.0,
            near: None,
            lens: None,
        };
        let view = View::from(&camera);
        let drawn = |up, size: UVec2| {
            let mut picture = grey(size);
            Overlay { axes: Some(up), ..Overlay::default() }.draw(&mut picture, &view);
            picture
        };
        let size = UVec2::new(400, 300);
        let middle = size - 32;
        let is = |picture: &DynamicImage, x: u32, y: u32, channel: usize| {
            let [r, g, b, _] = picture.get_pixel(x, y).0;
            let others = [r, g, b].into_iter().enumerate().filter(|(i, _)| *i != channel);
            others.map(|(_, value)| value).max() < Some([r, g, b][channel])
        };
        let (y_up, z_up) = (drawn(Up::Y, size), drawn(Up::Z, size));
        assert!(is(&y_up, middle.x + 12, middle.y, 0) && is(&z_up, middle.x + 12, middle.y, 0));
        assert!(is(&y_up, middle.x, middle.y - 12, 1) && is(&z_up, middle.x, middle.y - 12, 2));
        let small = UVec2::new(40, 30);
        assert_eq!(drawn(Up::Y, small), grey(small));
    }

    /// Over transparent pixels the letters are opaque, long names show their end, and no name leaves the picture.
    #[test]
    fn names_are_written_over_anything() {
        let clear: DynamicImage = RgbaImage::new(120, 24).into();
        for text in ["dam", "a/very/long/name/of/a/folder/dam_{}.bgeo", "水 é µ", ""] {
            let mut picture = clear.clone();
            name(&mut picture, text, 1);
            let opaque = picture.to_rgba8().pixels().filter(|pixel| pixel.0[3] == 255).count();
            assert_eq!(opaque > 20, !text.is_empty(), "{text}: {opaque}");
        }
    }
}
