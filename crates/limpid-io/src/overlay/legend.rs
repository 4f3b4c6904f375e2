//! The legend of colours that stand for values: a bar with ticks, and the name and the unit of the values above it.

use glam::{DVec2, UVec2};
use image::{DynamicImage, GenericImage as _, GenericImageView as _, Rgba, RgbaImage};

use super::text::Letters;
use super::{Ink, WHITE, over};
use crate::color_by::ColorScale;

/// Lengths in heights of a line of letters.
const MARGIN: f64 = 0.9;
const PADDING: f64 = 0.75;
const BAR: DVec2 = DVec2::new(0.95, 11.0);
const TICK: f64 = 0.3;

/// Colour and opacity of the panel behind the legend.
const PANEL: ([u8; 3], f32) = ([24, 26, 30], 0.72);

/// Draws a legend in the upper right corner of a picture, unless that is too small for it.
pub fn draw(picture: &mut DynamicImage, scale: &ColorScale) {
    if let Some(plan) = Plan::new(UVec2::from(picture.dimensions()), scale) {
        plan.draw(picture, scale);
    }
}

/// Whether a picture of this size has room for a legend.
pub fn fits(size: UVec2, scale: &ColorScale) -> bool {
    Plan::new(size, scale).is_some()
}

/// The legend of a picture of this size without the picture, and where its upper left corner is; `None` if that is too
/// small.
pub fn alone(size: UVec2, scale: &ColorScale) -> Option<(RgbaImage, UVec2)> {
    let plan = Plan::new(size, scale)?;
    let (corner, size) = (plan.corner.as_uvec2(), plan.size.as_uvec2());
    let mut picture = RgbaImage::new(size.x, size.y).into();
    Plan { corner: DVec2::ZERO, ..plan }.draw(&mut picture, scale);
    Some((picture.into_rgba8(), corner))
}

/// Where the parts of a legend are.
struct Plan {
    letters: Letters,
    /// Height of a line of letters, pixels.
    line: f64,
    title: String,
    /// Places on the bar, from 0 to 1, and the numbers there.
    ticks: Vec<(f64, String)>,
    /// Width of the widest number, pixels.
    widest: f64,
    /// The panel's upper left corner and its size, pixels.
    corner: DVec2,
    size: DVec2,
}

impl Plan {
    fn new(size: UVec2, scale: &ColorScale) -> Option<Self> {
        let (wide, high) = (f64::from(size.x), f64::from(size.y));
        let line = (0.032 * high.min(0.75 * wide)).max(13.0).round();
        let letters = Letters::new(line)?;
        let [low, high_value] = ends(scale.range);
        let (ticks, exponent) = ticks(low, high_value);
        let title = title(scale, exponent);
        let widest = ticks.iter().map(|(_, label)| letters.width(label)).fold(0.0, f64::max);
        let beside = BAR.x * line + 2.2 * TICK * line + widest;
        let inside = DVec2::new(beside.max(letters.width(&title)), (1.45 + BAR.y) * line);
        let panel = (inside + 2.0 * PADDING * line).round();
        let corner = DVec2::new(wide - panel.x - MARGIN * line, MARGIN * line).round();
        let fits = corner.x >= 0.0 && corner.y + panel.y <= high;
        fits.then_some(Self { letters, line, title, ticks, widest, corner, size: panel })
    }

    fn draw(&self, picture: &mut DynamicImage, scale: &ColorScale) {
        self.panel(picture);
        self.bar(picture, scale);
        let mut ink = Ink::new(UVec2::from(picture.dimensions()), 1);
        let title = self.corner + self.line * PADDING + self.title_drop();
        self.letters.write(&self.title, title, &mut ink);
        let (start, half) = (self.bar_corner(), 0.5 * self.letters.height());
        for (share, label) in &self.ticks {
            let y = start.y + (1.0 - share) * self.bar_size().y;
            let x = start.x + self.bar_size().x;
            ink.line(
                DVec2::new(x, y),
                DVec2::new(x + self.line * TICK, y),
                (0.07 * self.line).max(1.0),
            );
            let width = self.letters.width(label);
            // Figures end below each other.
            let left = x + self.line * 2.2 * TICK + self.widest - width;
            self.letters.write(label, DVec2::new(left, y + half), &mut ink);
        }
        ink.stain(picture, WHITE);
    }

    /// From the top of a line to its base.
    fn title_drop(&self) -> DVec2 {
        DVec2::new(0.0, 0.75 * self.line)
    }

    fn bar_corner(&self) -> DVec2 {
        let inside = self.corner + PADDING * self.line;
        (inside + DVec2::new(0.0, 1.45 * self.line)).round()
    }

    fn bar_size(&self) -> DVec2 {
        (BAR * self.line).round()
    }

    /// Darkens a rectangle with round corners.
    fn panel(&self, picture: &mut DynamicImage) {
        let (color, opacity) = PANEL;
        let radius = 0.4 * self.line;
        let (middle, half) = (self.corner + 0.5 * self.size, 0.5 * self.size - radius);
        for y in 0..self.size.y as u32 {
            for x in 0..self.size.x as u32 {
                let at = self.corner + DVec2::new(f64::from(x), f64::from(y)) + 0.5;
                let outside = ((at - middle).abs() - half).max(DVec2::ZERO).length() - radius;
                let share = opacity * (0.5 - outside).clamp(0.0, 1.0) as f32;
                let (x, y) = (self.corner.x as u32 + x, self.corner.y as u32 + y);
                let pixel = over(picture.get_pixel(x, y), color, share);
                picture.put_pixel(x, y, pixel);
            }
        }
    }

    /// Draws the colours, each row in that of the value in its middle.
    fn bar(&self, picture: &mut DynamicImage, scale: &ColorScale) {
        let (corner, size) = (self.bar_corner(), self.bar_size());
        for row in 0..size.y as u32 {
            let share = 1.0 - (f64::from(row) + 0.5) / size.y;
            let [r, g, b] = scale.map.srgb(share);
            for x in 0..size.x as u32 {
                let (x, y) = (corner.x as u32 + x, corner.y as u32 + row);
                picture.put_pixel(x, y, Rgba([r, g, b, 255]));
            }
        }
    }
}

/// The values at the ends of the bar. Where all are the same, theirs is in its middle, as in
/// [`limpid::liquid::ColorMap`].
fn ends([low, high]: [f32; 2]) -> [f64; 2] {
    let (low, high) = (f64::from(low), f64::from(high));
    if high > low { [low, high] } else { [low - 0.5, low + 0.5] }
}

/// The name of the values with their unit, in which they are multiples of 10 to the power `exponent`.
fn title(scale: &ColorScale, exponent: i32) -> String {
    let ColorScale { name, unit, .. } = scale;
    let power = format!("1e{exponent}").replace('-', "−");
    match (exponent, unit.as_str()) {
        (0, "") => name.clone(),
        (0, unit) => format!("{name} [{unit}]"),
        (_, "") => format!("{name} [{power}]"),
        (_, unit) => format!("{name} [{power} {unit}]"),
    }
}

/// About five round numbers of a range: their places from 0 to 1, their texts, and the power of ten that these leave out.
fn ticks(low: f64, high: f64) -> (Vec<(f64, String)>, i32) {
    /// Fewest and most of them.
    const FEWEST: f64 = 4.0;
    /// Numbers from here on, and below the inverse, leave out a power of ten.
    const LARGE: i32 = 5;
    let span = high - low;
    let decade = 10f64.powf((span / FEWEST).log10().floor());
    let step = [5.0, 2.0, 1.0].map(|step| step * decade);
    let step = step.into_iter().find(|&step| step <= span / FEWEST * (1.0 + 1e-9));
    let step = step.unwrap_or(decade);
    let largest = low.abs().max(high.abs());
    let magnitude = largest.log10().floor() as i32;
    let exponent = if (-3..LARGE).contains(&magnitude) { 0 } else { magnitude };
    let unit = 10f64.powi(exponent);
    // As many decimals as tell steps apart.
    let decimals = (-(step / unit).log10() - 1e-9).ceil().clamp(0.0, 9.0) as usize;
    let (first, last) = ((low / step - 1e-6).ceil(), (high / step + 1e-6).floor());
    let count = (last - first).clamp(0.0, 16.0) as u32;
    let tick = |k| {
        let value = (first + f64::from(k)) * step;
        // Without the sign of a 0.
        let number = value / unit + 0.0;
        let text = format!("{number:.decimals$}").replace('-', "−");
        (((value - low) / span).clamp(0.0, 1.0), text)
    };
    ((0..=count).map(tick).collect(), exponent)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::color_by::MapName;
    use image::{Rgb, RgbImage};

    fn scale(range: [f32; 2], unit: &str) -> ColorScale {
        let (name, unit) = ("temperature".into(), unit.into());
        ColorScale { name, unit, map: MapName::Viridis, range, automatic: false }
    }

    /// Ticks are round, lie in the range, and are four to ten; large and small numbers leave out a power of ten.
    #[test]
    fn ticks_are_round() {
        for (low, high, expected, power) in [
            (20.0, 80.0, "20 30 40 50 60 70 80", 0),
            (0.0, 1.0, "0.0 0.2 0.4 0.6 0.8 1.0", 0),
            (-1.0, 1.0, "−1.0 −0.5 0.0 0.5 1.0", 0),
            (0.013, 3.27, "0.5 1.0 1.5 2.0 2.5 3.0", 0),
            (998.2, 1003.9, "999 1000 1001 1002 1003", 0),
            (0.0, 4e5, "0 1 2 3 4", 5),
            (101_300.0, 101_350.0, "1.0130 1.0131 1.0132 1.0133 1.0134 1.0135", 5),
            (0.0, 6e-5, "0 1 2 3 4 5 6", -5),
        ] {
            let (found, exponent) = ticks(low, high);
            let texts: Vec<_> = found.iter().map(|(_, text)| text.as_str()).collect();
            assert_eq!((texts.join(" "), exponent), (expected.to_owned(), power));
            assert!(found.iter().all(|(share, _)| (0.0..=1.0).contains(share)));
        }
        for span in 1..2000 {
            let (found, _) = ticks(-7.3, -7.3 + f64::from(span) * 0.037);
            assert!((4..=11).contains(&found.len()), "{span}: {}", found.len());
        }
        assert_eq!(title(&scale([0.0, 1.0], "K"), 0), "temperature [K]");
        assert_eq!(title(&scale([0.0, 1.0], ""), 0), "temperature");
        assert_eq!(title(&scale([0.0, 1.0], "Pa"), -15), "temperature [1e−15 Pa]");
    }

    /// All letters of a title are in the font.
    #[test]
    fn the_font_has_every_sign() {
        let font = ab_glyph::FontRef::try_from_slice(epaint_default_fonts::UBUNTU_LIGHT).unwrap();
        for letter in "0123456789e−³[]/·µ°".chars() {
            assert_ne!(ab_glyph::Font::glyph_id(&font, letter).0, 0, "{letter}");
        }
    }

    /// A legend is within the picture, in the map's colours from the last to the first; pictures too small are left alone.
    #[test]
    fn legends_fit_their_pictures() {
        for (wide, high) in [(1280, 720), (640, 480), (3840, 2160), (400, 300), (720, 1280)] {
            let grey = RgbImage::from_pixel(wide, high, Rgb([90; 3]));
            let mut picture: DynamicImage = grey.clone().into();
            let scale = scale([0.0, 4e6], "Pa");
            draw(&mut picture, &scale);
            let plan = Plan::new(UVec2::new(wide, high), &scale).unwrap();
            let (corner, size) = (plan.bar_corner().as_uvec2(), plan.bar_size().as_uvec2());
            for (row, end) in [(0, 1.0), (size.y - 1, 0.0)] {
                let Rgba([r, g, b, _]) = picture.get_pixel(corner.x + 1, corner.y + row);
                let off = [r, g, b].into_iter().zip(MapName::Viridis.srgb(end));
                assert!(off.map(|(a, b)| a.abs_diff(b)).max() <= Some(4));
            }
            let changed = |x: u32, y: u32| picture.get_pixel(x, y).0[..3] != [90; 3];
            assert!((0..high).all(|y| !changed(wide - 1, y) && !changed(0, y)));
            assert!((0..wide).all(|x| !changed(x, 0) && !changed(x, high - 1)));
            // Alone it is the same, over whatever picture.
            let (legend, corner) = alone(UVec2::new(wide, high), &scale).unwrap();
            let mut laid: DynamicImage = grey.into();
            image::imageops::overlay(&mut laid, &legend, corner.x.into(), corner.y.into());
            let pairs = laid.as_bytes().iter().zip(picture.as_bytes());
            assert!(pairs.map(|(a, b)| a.abs_diff(*b)).max() <= Some(3));
        }
        let small = DynamicImage::from(RgbImage::from_pixel(64, 48, Rgb([90; 3])));
        let mut drawn = small.clone();
        draw(&mut drawn, &scale([0.0, 1.0], "K"));
        assert!(!fits(UVec2::new(64, 48), &scale([0.0, 1.0], "K")));
        assert_eq!(small, drawn);
    }
}
