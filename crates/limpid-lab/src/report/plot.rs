//! Plots as SVG, for a page that provides the styles.

use super::markdown::{percent, significant};

/// Size of a plot, and of the area inside its axes, pixels.
const SIZE: [f64; 2] = [480.0, 310.0];
const LEFT: f64 = 58.0;
const RIGHT: f64 = 466.0;
const TOP: f64 = 26.0;
const BOTTOM: f64 = 266.0;
/// Room for zero at the end of a logarithmic axis, pixels.
const ZERO: f64 = 26.0;
/// Axes of fewer decades have labels at 2 and 5 too; longer ones begin and end at decades.
const MANTISSAS_BELOW: f64 = 2.2;
/// Width of a character and height of a line, pixels.
const CHARACTER: [f64; 2] = [6.5, 13.0];

/// The scale of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Axis {
    /// Linear, whole numbers from zero.
    Count,
    /// Logarithmic.
    Log,
    /// Logarithmic, for shares.
    Percent,
    /// Logarithmic in the complement of a share, labelled with the share.
    Nines,
}

impl Axis {
    fn text(self, value: f64) -> String {
        match self {
            Self::Count => value.to_string(),
            Self::Log => trimmed(&significant(value)),
            Self::Percent => trimmed(&significant(100.0 * value)) + " %",
            Self::Nines => trimmed(&percent(1.0 - value)) + " %",
        }
    }
}

/// Removes trailing zeros of a fraction.
fn trimmed(number: &str) -> String {
    let (mantissa, exponent) = number.split_at(number.find('e').unwrap_or(number.len()));
    let mantissa = match mantissa.contains('.') {
        true => mantissa.trim_end_matches('0').trim_end_matches('.'),
        false => mantissa,
    };
    mantissa.to_owned() + exponent
}

/// A point of a plot; skipped if it is not finite. Negative values count as zero.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Point {
    pub(super) x: f64,
    pub(super) y: f64,
    /// Half the width of its error bar, in units of x.
    pub(super) spread: f64,
    /// Drawn next to it if there is room.
    pub(super) label: String,
    /// The tooltip.
    pub(super) name: String,
    /// Drawn with emphasis.
    pub(super) ours: bool,
}

/// A scatter plot.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plot {
    pub(super) title: String,
    pub(super) x: (&'static str, Axis),
    pub(super) y: (&'static str, Axis),
    pub(super) points: Vec<Point>,
    /// Polylines, as indices of their points.
    pub(super) lines: Vec<Vec<usize>>,
    /// Whether to draw the Pareto front.
    pub(super) front: bool,
}

/// The Pareto front: indices of the points that no other point dominates, from the smallest x to
/// the smallest y. A point dominates another if it is no larger in both coordinates and smaller in
/// one. Equal points are either all on the front or none of them; non-finite points never are.
pub fn pareto(points: &[(f64, f64)]) -> Vec<usize> {
    let finite = |&i: &usize| points[i].0.is_finite() && points[i].1.is_finite();
    let mut order: Vec<usize> = (0..points.len()).filter(finite).collect();
    order.sort_by(|&a, &b| {
        points[a].partial_cmp(&points[b]).expect("finite numbers have an order").then(a.cmp(&b))
    });
    let mut front: Vec<usize> = Vec::new();
    for i in order {
        if front.last().is_none_or(|&j| points[i].1 < points[j].1 || points[i] == points[j]) {
            front.push(i);
        }
    }
    front
}

/// Escapes text for HTML and SVG, quotes included.
pub(super) fn escape(text: &str) -> String {
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    text.replace('"', "&quot;").replace('\'', "&#39;")
}

/// The mapping from values to pixels.
struct Scale {
    axis: Axis,
    /// The ends: values on a `Count` axis, otherwise their decadic logarithms.
    ends: [f64; 2],
    /// Pixels of the ends.
    pixels: [f64; 2],
    /// Pixel of zero.
    zero: Option<f64>,
}

/// The logarithm of the nearest 1, 2 or 5 times a power of ten below (`sign` −1) or above (1).
fn tick(log: f64, sign: f64) -> f64 {
    let decade = log.floor();
    let ticks = [1f64, 2.0, 5.0, 10.0].map(|mantissa| decade + mantissa.log10());
    if sign < 0.0 {
        ticks.into_iter().rev().find(|&tick| tick <= log + 1e-9).unwrap_or(decade)
    } else {
        ticks.into_iter().find(|&tick| tick >= log - 1e-9).unwrap_or(decade + 1.0)
    }
}

impl Scale {
    fn new(axis: Axis, values: impl Iterator<Item = f64>, pixels: [f64; 2]) -> Self {
        let (mut low, mut high, mut zero) = (f64::INFINITY, 0f64, false);
        for value in values {
            // A complement is at most 1.
            let value = if axis == Axis::Nines { value.min(1.0) } else { value };
            high = high.max(value);
            if value > 0.0 {
                low = low.min(value);
            } else {
                zero = true;
            }
        }
        if axis == Axis::Count {
            return Self { axis, ends: [0.0, high.max(1.0)], pixels, zero: None };
        }
        if high <= 0.0 {
            (low, high) = (0.1, 1.0);
        }
        let mut ends = [tick(low.log10(), -1.0), tick(high.log10(), 1.0)];
        if axis == Axis::Nines {
            ends[1] = ends[1].min(0.0);
        }
        if ends[1] - ends[0] < 1e-6 {
            ends[0] = tick(ends[0] - 0.01, -1.0);
            if axis != Axis::Nines {
                ends[1] = tick(ends[1] + 0.01, 1.0);
            }
        }
        if ends[1] - ends[0] >= MANTISSAS_BELOW {
            ends = [ends[0].floor(), ends[1].ceil()];
        }
        let start = if zero { ZERO.copysign(pixels[1] - pixels[0]) } else { 0.0 };
        let zero = zero.then_some(pixels[0]);
        Self { axis, ends, pixels: [pixels[0] + start, pixels[1]], zero }
    }

    fn pixel(&self, value: f64) -> f64 {
        let value = match self.axis {
            Axis::Count => value,
            _ if value <= 0.0 => return self.zero.unwrap_or(self.pixels[0]),
            _ => value.log10(),
        };
        let share = (value - self.ends[0]) / (self.ends[1] - self.ends[0]);
        self.pixels[0] + share.clamp(0.0, 1.0) * (self.pixels[1] - self.pixels[0])
    }

    /// Tick values, and whether they are labelled.
    fn ticks(&self) -> Vec<(f64, bool)> {
        let [low, high] = self.ends;
        if self.axis == Axis::Count {
            let step = 10f64.powf(tick((high / 8.0).max(1.0).log10(), 1.0)).round();
            return (0..=(high / step) as u32).map(|i| (f64::from(i) * step, true)).collect();
        }
        let step = ((high - low) / 6.0).ceil().max(1.0);
        let mut ticks: Vec<(f64, bool)> = self.zero.iter().map(|_| (0.0, true)).collect();
        let mut decade = (low / step).floor() * step;
        while decade <= high {
            for mantissa in 1..10 {
                let value = f64::from(mantissa) * 10f64.powf(decade);
                let within = value.log10() > low - 1e-6 && value.log10() < high + 1e-6;
                let major =
                    mantissa == 1 || high - low < MANTISSAS_BELOW && [2, 5].contains(&mantissa);
                if within && (major || step == 1.0) {
                    ticks.push((value, major));
                }
            }
            decade += step;
        }
        ticks
    }
}

/// A label's box (left, top, right, bottom), and whether it is far enough from its point to need a
/// leader line.
type Label = ([f64; 4], bool);

/// Places labels one by one where they cover neither each other nor a point nor the front; `None`
/// for labels without room.
fn place(
    points: &[[f64; 2]],
    front: &[[f64; 4]],
    labels: &[&str],
    order: &[usize],
) -> Vec<Option<Label>> {
    const RIGHTWARDS: [f64; 8] = [1.0, -1.0, 0.0, 0.0, 1.0, 1.0, -1.0, -1.0];
    const DOWNWARDS: [f64; 8] = [0.0, 0.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0];
    let meet =
        |a: &[f64; 4], b: &[f64; 4]| a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
    let around = |[x, y]: [f64; 2], by: f64| [x - by, y - by, x + by, y + by];
    let mut occupied: Vec<[f64; 4]> = points.iter().map(|&point| around(point, 4.0)).collect();
    occupied.extend_from_slice(front);
    let mut placed = vec![None; points.len()];
    for &i in order.iter().filter(|&&i| !labels[i].is_empty()) {
        let half = [0.5 * CHARACTER[0] * labels[i].chars().count() as f64, 0.5 * CHARACTER[1]];
        let found = [8.0, 16.0, 28.0, 42.0, 58.0].iter().find_map(|&far| {
            RIGHTWARDS.iter().zip(DOWNWARDS).find_map(|(right, down)| {
                let shift = far * if right * down == 0.0 { 1.0 } else { 0.6 };
                let x = points[i][0] + right * (half[0] + shift);
                let y = points[i][1] + down * (half[1] + shift);
                let label = [x - half[0], y - half[1], x + half[0], y + half[1]];
                let inside = label[0] > LEFT
                    && label[2] < SIZE[0]
                    && label[1] > TOP - 8.0
                    && label[3] < BOTTOM;
                (inside && !occupied.iter().any(|other| meet(&label, other)))
                    .then_some((label, far > 10.0))
            })
        });
        if let Some((label, _)) = found {
            occupied.push(label);
        }
        placed[i] = found;
    }
    placed
}

/// Renders a plot; empty if it has no points.
pub(super) fn svg(plot: &Plot) -> String {
    let drawn: Vec<usize> = (0..plot.points.len())
        .filter(|&i| plot.points[i].x.is_finite() && plot.points[i].y.is_finite())
        .collect();
    if drawn.is_empty() {
        return String::new();
    }
    let value = |&i: &usize| (plot.points[i].x.max(0.0), plot.points[i].y.max(0.0));
    let values: Vec<(f64, f64)> = drawn.iter().map(value).collect();
    let x = Scale::new(plot.x.1, values.iter().map(|v| v.0), [LEFT, RIGHT]);
    let upwards = if plot.y.1 == Axis::Nines { [TOP, BOTTOM] } else { [BOTTOM, TOP] };
    let y = Scale::new(plot.y.1, values.iter().map(|v| v.1), upwards);
    let pixels: Vec<[f64; 2]> = values.iter().map(|v| [x.pixel(v.0), y.pixel(v.1)]).collect();

    let [width, height] = SIZE;
    let title = escape(&plot.title);
    let mut svg =
        format!("<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{title}\">\n");
    for (value, major) in x.ticks() {
        let at = x.pixel(value);
        let top = if major { TOP } else { BOTTOM - 4.0 };
        svg += &format!("<path class=\"grid\" d=\"M{at:.1} {top:.1}V{BOTTOM:.1}\"/>\n");
        if major {
            let (text, below) = (x.axis.text(value), BOTTOM + 15.0);
            svg += &format!("<text x=\"{at:.1}\" y=\"{below}\" class=\"middle\">{text}</text>\n");
        }
    }
    for (value, major) in y.ticks() {
        let at = y.pixel(value);
        let right = if major { RIGHT } else { LEFT + 4.0 };
        svg += &format!("<path class=\"grid\" d=\"M{LEFT:.1} {at:.1}H{right:.1}\"/>\n");
        if major {
            let (text, left, base) = (y.axis.text(value), LEFT - 6.0, at + 4.0);
            svg += &format!("<text x=\"{left}\" y=\"{base:.1}\" class=\"end\">{text}</text>\n");
        }
    }
    let (middle, foot) = (0.5 * (LEFT + RIGHT), height - 8.0);
    let (x_name, y_name) = (escape(plot.x.0), escape(plot.y.0));
    svg += &format!("<text x=\"{middle}\" y=\"{foot}\" class=\"middle\">{x_name}</text>\n");
    svg += &format!("<text x=\"2\" y=\"12\">{y_name}</text>\n");

    let front = if plot.front { pareto(&values) } else { Vec::new() };
    let mut steps = Vec::new();
    if let Some(&first) = front.first() {
        let ([mut left, _], mut top) = (pixels[first], TOP);
        let mut path = format!("M{left:.1} {TOP:.1}");
        for [x, y] in front.iter().map(|&i| pixels[i]) {
            path += &format!("H{x:.1}V{y:.1}");
            steps.extend([[left, top - 1.0, x, top + 1.0], [x - 1.0, top, x + 1.0, y]]);
            (left, top) = (x, y);
        }
        steps.push([left, top - 1.0, RIGHT, top + 1.0]);
        svg += &format!("<path class=\"front\" d=\"{path}H{RIGHT:.1}\"/>\n");
    }
    for line in &plot.lines {
        let at = line.iter().filter_map(|i| drawn.binary_search(i).ok()).map(|i| pixels[i]);
        let path: Vec<String> = at.map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        svg += &format!("<polyline class=\"line\" points=\"{}\"/>\n", path.join(" "));
    }

    let labels: Vec<&str> = drawn.iter().map(|&i| plot.points[i].label.as_str()).collect();
    let mut order: Vec<usize> = (0..drawn.len()).collect();
    order.sort_by_key(|i| (!plot.points[drawn[*i]].ours, !front.contains(i)));
    let placed = place(&pixels, &steps, &labels, &order);
    // Emphasised points are drawn last, on top.
    for &i in order.iter().rev() {
        let (point, [px, py]) = (&plot.points[drawn[i]], pixels[i]);
        let class = if point.ours { "ours" } else { "other" };
        let radius = if point.ours { 5.0 } else { 3.5 };
        let (x_text, y_text) = (plot.x.1.text(values[i].0), plot.y.1.text(values[i].1));
        let (x_name, y_name) = (plot.x.0, plot.y.0);
        let tooltip = escape(&format!("{}: {x_text} {x_name}, {y_text} {y_name}", point.name));
        svg += &format!("<g class=\"{class}\"><title>{tooltip}</title>");
        if point.spread.is_finite() && point.spread > 0.0 {
            let ends = [-1.0, 1.0].map(|sign| x.pixel(values[i].0 + sign * point.spread));
            svg += &format!("<path d=\"M{:.1} {py:.1}H{:.1}\"/>", ends[0], ends[1]);
        }
        if let Some(([left, top, right, bottom], far)) = placed[i] {
            if far {
                let (x, y) = (px.clamp(left, right), py.clamp(top, bottom));
                svg += &format!("<path class=\"lead\" d=\"M{px:.1} {py:.1}L{x:.1} {y:.1}\"/>");
            }
            let (middle, base, text) = (0.5 * (left + right), bottom - 3.0, escape(labels[i]));
            svg +=
                &format!("<text x=\"{middle:.1}\" y=\"{base:.1}\" class=\"middle\">{text}</text>");
        }
        svg += &format!("<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"{radius}\"/></g>\n");
    }
    svg + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, y: f64) -> Point {
        Point { x, y, spread: 0.1, label: "a<b".into(), name: "a<b".into(), ours: false }
    }

    fn plot(points: Vec<Point>) -> Plot {
        let lines = vec![(0..points.len()).collect()];
        let (x, y) = (("ms", Axis::Log), ("rays wrong", Axis::Percent));
        Plot { title: "pool".into(), x, y, points, lines, front: true }
    }

    /// Known Pareto fronts, with ties, equal points and non-finite points.
    #[test]
    fn pareto_known_answers() {
        assert_eq!(pareto(&[]), [] as [usize; 0]);
        assert_eq!(pareto(&[(3.0, 3.0)]), [0]);
        // Point 2 is dominated by point 1; point 4 equals point 3 in x and is worse in y.
        let points = [(1.0, 9.0), (2.0, 4.0), (3.0, 5.0), (4.0, 1.0), (4.0, 2.0)];
        assert_eq!(pareto(&points), [0, 1, 3]);
        // A slower point of the same error is dominated, and so is a less exact one of the same
        // time.
        assert_eq!(pareto(&[(2.0, 1.0), (1.0, 1.0), (1.0, 2.0)]), [1]);
        assert_eq!(pareto(&[(1.0, 1.0), (1.0, 1.0)]), [0, 1]);
        assert_eq!(pareto(&[(f64::NAN, 0.0), (0.0, f64::INFINITY), (5.0, 5.0)]), [2]);
        assert_eq!(pareto(&[(0.0, 1.0), (-0.0, 0.0)]), [1]);
    }

    /// The front of unordered points satisfies its definition.
    #[test]
    fn pareto_matches_its_definition() {
        let points: Vec<(f64, f64)> =
            (0..60).map(|i| (f64::from(i * 37 % 23), f64::from(i * 53 % 19))).collect();
        let dominates = |a: (f64, f64), b: (f64, f64)| a.0 <= b.0 && a.1 <= b.1 && a != b;
        let mut front = pareto(&points);
        front.sort_unstable();
        let expected: Vec<usize> =
            (0..60).filter(|&i| !points.iter().any(|&p| dominates(p, points[i]))).collect();
        assert_eq!(front, expected);
    }

    /// Decades have equal length, zero has its own place before them, and the share of solved rays
    /// increases upwards.
    #[test]
    fn axis_scales() {
        let scale = Scale::new(Axis::Log, [0.1, 1.0, 10.0].into_iter(), [0.0, 200.0]);
        let pixels = [0.0, 0.1, 1.0, 10.0].map(|value| scale.pixel(value).round());
        assert_eq!(pixels, [0.0, 0.0, 100.0, 200.0]);
        let scale = Scale::new(Axis::Log, [0.0, 0.1, 10.0].into_iter(), [200.0, 0.0]);
        assert_eq!([0.0, 0.1, 10.0].map(|value| scale.pixel(value)), [200.0, 174.0, 0.0]);
        assert_eq!(scale.ticks()[0], (0.0, true));
        let labels = |axis: Axis, values: &[f64]| -> Vec<String> {
            let scale = Scale::new(axis, values.iter().copied(), [0.0, 200.0]);
            let major = scale.ticks().into_iter().filter(|tick| tick.1);
            major.map(|tick| axis.text(tick.0)).collect()
        };
        assert_eq!(labels(Axis::Log, &[0.3, 4.0]), ["0.2", "0.5", "1", "2", "5"]);
        assert_eq!(
            labels(Axis::Percent, &[1e-4, 0.5]),
            ["0.01 %", "0.1 %", "1 %", "10 %", "100 %"]
        );
        assert_eq!(
            labels(Axis::Nines, &[0.0, 1.0, 0.001]),
            ["100 %", "99.9 %", "99 %", "90 %", "0 %"]
        );
        assert_eq!(labels(Axis::Count, &[0.0, 7.0]).len(), 8);
        assert_eq!(
            labels(Axis::Count, &[40.0]),
            ["0", "5", "10", "15", "20", "25", "30", "35", "40"]
        );
    }

    /// With extreme data all coordinates are finite and all finite points are drawn inside the
    /// axes.
    #[test]
    fn extreme_data() {
        let cases: [&[(f64, f64)]; 8] = [
            &[(1.0, 0.01)],
            &[(0.0, 0.0)],
            &[(2.0, 0.1); 30],
            &[(-1.0, 0.0), (5.0, 0.0), (0.0, 3.0)],
            &[(1e-300, 1e-320), (1e300, 1e18)],
            &[(f64::NAN, 1.0), (1.0, f64::NEG_INFINITY), (1.0, 1.0)],
            &[(f64::MAX, f64::MIN_POSITIVE)],
            &[(9.99999, 1.0), (10.00001, 1.0)],
        ];
        for case in cases {
            for axis in [Axis::Log, Axis::Percent, Axis::Nines, Axis::Count] {
                let mut plot = plot(case.iter().map(|&(x, y)| point(x, y)).collect());
                (plot.x.1, plot.y.1) = (axis, axis);
                let svg = svg(&plot);
                assert!(!svg.contains("NaN") && !svg.contains("inf"), "{case:?} {axis:?}: {svg}");
                assert!(!svg.contains("a<b"));
                let finite = case.iter().filter(|p| p.0.is_finite() && p.1.is_finite()).count();
                assert_eq!(svg.matches("<circle").count(), finite);
                for (name, range) in [("cx=\"", LEFT..=RIGHT), ("cy=\"", TOP..=BOTTOM)] {
                    for part in svg.split(name).skip(1) {
                        let at: f64 = part[..part.find('"').unwrap()].parse().unwrap();
                        assert!(range.contains(&at), "{case:?}: {name}{at}");
                    }
                }
            }
        }
        assert_eq!(svg(&plot(vec![point(f64::NAN, 1.0)])), "");
    }

    /// Labels overlap neither each other nor points.
    #[test]
    fn labels_do_not_overlap() {
        let points: Vec<[f64; 2]> =
            (0..12).map(|i| [200.0 + 9.0 * f64::from(i % 4), 100.0 + 7.0 * f64::from(i)]).collect();
        let order: Vec<usize> = (0..points.len()).collect();
        let placed = place(&points, &[], &["guarded"; 12], &order);
        let boxes: Vec<[f64; 4]> = placed.into_iter().flatten().map(|label| label.0).collect();
        assert!(boxes.len() >= 8, "{}", boxes.len());
        let meet =
            |a: &[f64; 4], b: &[f64; 4]| a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3];
        for (i, a) in boxes.iter().enumerate() {
            assert!(boxes[..i].iter().all(|b| !meet(a, b)));
            assert!(points.iter().all(|[x, y]| !meet(a, &[x - 3.0, y - 3.0, x + 3.0, y + 3.0])));
        }
    }
}
