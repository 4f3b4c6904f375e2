//! The report as a self-contained HTML page.

use std::io::Cursor;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{ImageFormat, RgbImage};

use super::markdown::{
    BUDGETS, KINDS, Table, budgets, distinct, elisions, error_name, measurements, orders, percent,
    rates, significant, stress,
};
use super::plot::{Axis, Plot, Point, escape, svg};
use super::{ErrorKind, Figure, Report, Row, RowKind};
use crate::html_shell::page;

const STYLE: &str = "
:root { --front: #e0862b }
@media (prefers-color-scheme: dark) { :root { --front: #e09a4f } }
h2 { font-size: 1.35rem; margin: 3.5rem 0 .5rem; padding-top: .7rem; border-top: 1px solid var(--line) }
p, dl { max-width: 44rem; margin: .6rem 0 }
.dim, dd, figcaption { color: var(--dim) }
nav { display: flex; flex-wrap: wrap; gap: 0 1rem }
.bar { width: 16rem; vertical-align: middle }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .15rem 1rem; font-size: .9rem }
dd { margin: 0 }
figcaption { font-size: .85rem; margin: .3rem 0 }
.plots { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 27rem), 1fr));
  gap: 2rem; margin: 1.5rem 0 }
.plots figcaption { color: var(--text); font-weight: 600 }
svg { width: 100%; height: auto; font: 11px system-ui, sans-serif; fill: var(--dim) }
svg .middle { text-anchor: middle }
svg .end { text-anchor: end }
svg path, svg polyline { fill: none }
svg .grid { stroke: var(--line) }
svg .front { stroke: var(--front); stroke-width: 1.5 }
svg .line { stroke: var(--dim); stroke-dasharray: 2 3 }
svg g { fill: var(--text) }
svg g text { paint-order: stroke; stroke: var(--back); stroke-width: 3px }
svg g path, svg .other circle { stroke: var(--dim) }
svg .lead { stroke-width: .6 }
svg .other circle { fill: var(--back); stroke-width: 1.3 }
svg .ours { fill: var(--accent); font-weight: 700 }
svg .ours path { stroke: var(--accent) }
caption { text-align: left; font-weight: 600; padding-bottom: .3rem }
th, td { text-align: left; padding: .22rem 1.1rem .22rem 0; vertical-align: bottom }
th { font-weight: 500; color: var(--dim); border-bottom: 1px solid var(--line); max-width: 7rem }
td { white-space: nowrap }
tr.ours td { color: var(--accent); font-weight: 600 }
.number { text-align: right }
.bar div { height: .7rem; background: var(--accent); opacity: .75; min-width: 1px }
.panels { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 14rem), 1fr));
  gap: .6rem; margin: .4rem 0 2rem }
.panels img { display: block; width: 100%; height: auto }
h3 { font-size: 1rem; margin: 1.2rem 0 0 }
dialog img { display: block }
dialog p { margin: .3rem .6rem; font-size: .85rem }
";

/// Shows a picture in full size on click; the arrow keys switch to its neighbours.
const SCRIPT: &str = "
const dialog = document.querySelector('dialog'), [picture, caption] = dialog.children;
let shown;
const show = button => {
  if (!button) return;
  shown = button;
  picture.src = button.firstElementChild.src;
  caption.textContent = button.nextElementSibling.textContent;
  if (!dialog.open) dialog.showModal();
};
document.addEventListener('click', event =>
  dialog.open ? dialog.close() : show(event.target.closest('.panels button')));
dialog.addEventListener('keydown', event => {
  const panel = shown.parentElement;
  if (event.key == 'ArrowRight') show(panel.nextElementSibling?.firstElementChild);
  if (event.key == 'ArrowLeft') show(panel.previousElementSibling?.firstElementChild);
});
";

const READING: &str = "<p>Speed against error: left is faster, lower is more accurate. Axes are \
logarithmic; zero, where there is one, stands at their end. The stepped line is the Pareto front: \
nothing that was measured is both faster and more accurate than what lies on it. \
limpid's own methods are filled. Times are medians on the device; bars, and ± in the tables, are \
half the range between the quartiles.</p>\n";

/// The introduction to the budgets.
const BUDGETING: &str = "<p>What each pass must move (MB) and compute (Mop: millions of operations), \
the longer of the times that these take at the adapter's best (floor), and the time that the pass \
takes. RATES</p>\n";

/// The introduction to the rows of a kind.
fn reading(kind: RowKind) -> &'static str {
    match kind {
        RowKind::Intersect => {
            "<p>At every pixel a ray is refracted where it enters the liquid and followed once, to \
             where it leaves. The last plots show how a method gets there iteration by iteration; \
             their axis tells 99 % from 99.9 %.</p>\n\
             <dl><dt>solvable</dt><dd>a ray whose true hit the layers show: neither hidden nor \
             beyond the picture</dd>\
             <dt>solved</dt><dd>its hit is within a pixel of the truth, and at its depth</dd>\
             <dt>wrong accept</dt><dd>a hit of a ray that cannot be solved, or one more than two \
             pixels off or at another depth; as a share of all rays</dd>\
             <dt>rays wrong</dt><dd>solvable rays that were not solved, and hits of rays that cannot \
             be solved; each ray once, as a share of all rays</dd>\
             <dt>ms</dt><dd>net: the cost of everything but the intersection is \
             subtracted</dd>\
             <dt>fetches</dt><dd>texels read per ray, mean</dd>\
             <dt>iterations</dt><dd>evaluations of a layer per ray, mean</dd></dl>\n"
        }
        RowKind::Smooth => {
            "<p>The splatted layers are smoothed, all iterations of a filter together, and compared \
             with the true surface at the pixels that both cover. Depths differ most at silhouettes, \
             where a pixel more or less is another surface: their error is told over all pixels, and \
             without the tenth that differs most.</p>\n"
        }
        RowKind::Caustics => {
            "<p>The irradiance that light through the liquid brings to the solids, as a map in the \
             light's own view, against light traced in 64 bits through the true surface. Of pools \
             the layers are exact, so that the error is the method's alone; elsewhere they are \
             drawn from the particles, and the error is mostly theirs.</p>\n\
             <dl><dt>light kept</dt><dd>the light in the map over the light that truly falls \
             there</dd>\
             <dt>several paths</dt><dd>texels to which light comes by more than one path, of those \
             to which it comes; <code>gather</code> finds one of them</dd>\
             <dt>solved</dt><dd>texels in liquid for which <code>gather</code> found a path</dd>\
             <dt>grid n/k</dt><dd>n cells along the map, each laid in k × k parts</dd></dl>\n"
        }
        RowKind::Picture => {
            "<p>Whole frames. Mean FLIP is the difference that is seen when two pictures are \
             alternated, 0 (alike) to 1 (Andersson et al. 2020).</p>\n"
        }
        RowKind::Pass => "<p>Where the time of a frame goes.</p>\n",
        // Elisions are not rows.
        RowKind::Elision => "",
    }
}

/// Whether a method is one of limpid's own.
fn ours(method: &str) -> bool {
    let name = method.split([' ', ':', ',', '(']).next();
    name.is_some_and(|name| ["guarded", "limpid", "plane-fit"].contains(&name))
}

/// The iteration count of a row that belongs to a sweep over iterations.
fn sweep(row: &Row) -> Option<u32> {
    row.settings.strip_prefix("iterations=")?.parse().ok()
}

/// The sweeps over iterations, one per method, in ascending order, as indices into `rows`.
fn sweeps(rows: &[&Row]) -> Vec<Vec<usize>> {
    let of = |method: &str| {
        let mut sweep: Vec<(u32, usize)> = (0..rows.len())
            .filter(|&i| rows[i].method == method)
            .filter_map(|i| Some((sweep(rows[i])?, i)))
            .collect();
        sweep.sort_unstable();
        sweep.into_iter().map(|(_, i)| i).collect::<Vec<_>>()
    };
    let sweeps = distinct(rows, |row| row.method.as_str()).into_iter().map(of);
    sweeps.filter(|sweep| sweep.len() > 1).collect()
}

/// Plots of time against error, for each scene and each kind of error.
fn speed_plots(rows: &[&Row]) -> Vec<Plot> {
    let mut plots = Vec::new();
    for scene in distinct(rows, |row| &row.scene) {
        for kind in distinct(rows, |row| row.error_kind).into_iter().flatten() {
            let shown: Vec<&Row> = (rows.iter().copied())
                .filter(|row| row.scene == *scene && row.error_kind == Some(kind))
                .filter(|row| row.ms.is_some() && row.error.is_some())
                .collect();
            let lines = sweeps(&shown);
            // Settings shared by all rows are omitted.
            let alike = shown.iter().all(|row| row.settings == shown[0].settings);
            let label = |i: usize| match (sweep(shown[i]), shown[i]) {
                // The first point of a line is labelled with the method, the others with their
                // numbers only.
                (Some(n), _) if lines.iter().any(|line| line[1..].contains(&i)) => n.to_string(),
                (Some(n), row) => format!("{} {n}", row.method),
                (None, row) if alike => row.method.clone(),
                (None, row) => format!("{} {}", row.method, row.settings).trim_end().to_owned(),
            };
            let point = |(i, row): (usize, &&Row)| Point {
                x: row.ms.unwrap_or(f64::NAN),
                y: row.error.unwrap_or(f64::NAN),
                spread: row.ms_spread.unwrap_or(0.0),
                label: label(i),
                name: format!("{} {}", row.method, row.settings).trim_end().to_owned(),
                ours: ours(&row.method),
            };
            let axis = if kind == ErrorKind::RaysWrong { Axis::Percent } else { Axis::Log };
            plots.push(Plot {
                title: scene.clone(),
                x: ("ms", Axis::Log),
                y: (error_name(kind), axis),
                points: shown.iter().enumerate().map(point).collect(),
                lines,
                front: true,
            });
        }
    }
    plots
}

/// Plots of the share of solved rays against iterations, for each scene with methods that vary
/// them.
fn convergence_plots(rows: &[&Row]) -> Vec<Plot> {
    let curve = |scene: &String| {
        let of: Vec<&Row> = rows.iter().copied().filter(|row| row.scene == *scene).collect();
        let (mut points, mut lines) = (Vec::new(), Vec::new());
        for rows in sweeps(&of) {
            type Share = fn(&Row) -> Option<f64>;
            let shares: [(&str, Share); 2] = [
                ("of solvable", |row| row.solved_of_solvable),
                ("of all", |row| row.solved_of_all),
            ];
            for (name, share) in shares {
                let (first, method) = (points.len(), &of[rows[0]].method);
                for &i in &rows {
                    points.extend(share(of[i]).zip(sweep(of[i])).map(|(share, n)| Point {
                        x: f64::from(n),
                        y: 1.0 - share,
                        spread: 0.0,
                        label: String::new(),
                        name: format!("{method}, {name}"),
                        ours: ours(method),
                    }));
                }
                if let Some(last) = points[first..].last_mut() {
                    last.label.clone_from(&last.name);
                }
                lines.push((first..points.len()).collect());
            }
        }
        let (x, y) = (("iterations", Axis::Count), ("rays solved", Axis::Nines));
        Plot { title: format!("{scene}: convergence"), x, y, points, lines, front: false }
    };
    distinct(rows, |row| &row.scene).into_iter().map(curve).collect()
}

fn figures_of_plots(plots: &[Plot]) -> String {
    let mut html = String::new();
    for plot in plots {
        let svg = svg(plot);
        if !svg.is_empty() {
            let caption = escape(&plot.title);
            html += &format!("<figure><figcaption>{caption}</figcaption>\n{svg}</figure>\n");
        }
    }
    if html.is_empty() { html } else { format!("<div class=\"plots\">\n{html}</div>\n") }
}

/// A table; each row ends with a bar if `bars` has lengths.
fn table_html(caption: &str, table: &Table, bars: &[f64]) -> String {
    let class = |number: bool| if number { " class=\"number\"" } else { "" };
    let method = table.head.iter().position(|(name, _)| *name == "method");
    let caption = escape(caption);
    let mut html = format!("<div class=\"wide\"><table><caption>{caption}</caption>\n<tr>");
    for (name, number) in &table.head {
        html += &format!("<th{}>{}</th>", class(*number), escape(name));
    }
    html += "</tr>\n";
    for (i, row) in table.rows.iter().enumerate() {
        let ours = method.is_some_and(|i| ours(&row[i]));
        html += if ours { "<tr class=\"ours\">" } else { "<tr>" };
        for (cell, (_, number)) in row.iter().zip(&table.head) {
            html += &format!("<td{}>{}</td>", class(*number), escape(cell));
        }
        if let Some(percent) = bars.get(i).map(|bar| 100.0 * bar) {
            html += &format!("<td class=\"bar\"><div style=\"width:{percent:.1}%\"></div></td>");
        }
        html += "</tr>\n";
    }
    html + "</table></div>\n"
}

/// The passes of each frame with their share of its time.
fn passes(rows: &[&Row]) -> String {
    let mut html = String::new();
    for (scene, settings) in distinct(rows, |row| (&row.scene, &row.settings)) {
        let of = rows.iter().filter(|row| (&row.scene, &row.settings) == (scene, settings));
        let time = |row: &Row| row.ms.filter(|ms| ms.is_finite() && *ms > 0.0).unwrap_or(0.0);
        let sum: f64 = of.clone().map(|row| time(row)).sum();
        // Never zero, so that it can divide.
        let longest = of.clone().map(|row| time(row)).fold(f64::MIN_POSITIVE, f64::max);
        let numbers = |row: &Row| {
            let [ms, spread] =
                [row.ms, row.ms_spread].map(|ms| ms.map_or(String::new(), significant));
            vec![row.method.clone(), ms, spread, percent(time(row) / sum.max(longest))]
        };
        let head = vec![("pass", false), ("ms", true), ("±", true), ("%", true)];
        let table = Table { head, rows: of.clone().map(|row| numbers(row)).collect() };
        let caption = format!("{scene} {settings}: {} ms", significant(sum));
        let bars: Vec<f64> = of.map(|row| time(row) / longest).collect();
        html += &table_html(&caption, &table, &bars);
    }
    html
}

/// Encodes a picture as a data URI; `None` if it has no pixels.
fn data_uri(picture: &RgbImage) -> Option<String> {
    let mut png = Cursor::new(Vec::new());
    picture.write_to(&mut png, ImageFormat::Png).ok()?;
    Some(format!("data:image/png;base64,{}", STANDARD.encode(png.into_inner())))
}

fn pictures(figures: &[Figure]) -> String {
    let mut html = String::new();
    for figure in figures {
        let (title, scene) = (escape(&figure.title), escape(&figure.scene));
        html += &format!(
            "<h3>{title} <span class=\"dim\">{scene}</span></h3>\n<div class=\"panels\">\n"
        );
        for (caption, picture) in &figure.panels {
            let (caption, [width, height]) = (escape(caption), picture.dimensions().into());
            let Some(uri) = data_uri(picture) else { continue };
            html += &format!(
                "<figure><button type=\"button\"><img src=\"{uri}\" alt=\"{caption}\" \
                 width=\"{width}\" height=\"{height}\"></button>\
                 <figcaption>{caption}</figcaption></figure>\n"
            );
        }
        html += "</div>\n";
    }
    html
}

/// The non-empty sections: id, title, content.
fn sections(report: &Report) -> Vec<(&'static str, &'static str, String)> {
    let mut sections = Vec::new();
    for (kind, id, title) in KINDS {
        let rows: Vec<&Row> = report.rows.iter().filter(|row| row.kind == kind).collect();
        if rows.is_empty() {
            continue;
        }
        let mut html = reading(kind).to_owned();
        let truths = distinct(&rows, |row| row.truth.as_deref());
        for truth in truths.into_iter().flatten() {
            html += &format!("<p class=\"dim\">Truth: {}.</p>\n", escape(truth));
        }
        if kind == RowKind::Pass {
            html += &passes(&rows);
        } else {
            let mut plots = speed_plots(&rows);
            plots.extend(convergence_plots(&rows));
            html += &(figures_of_plots(&plots) + &table_html("", &measurements(&rows, false), &[]));
        }
        sections.push((id, title, html));
    }
    if !report.budgets.is_empty() {
        let html = BUDGETING.replace("RATES", &rates(report.rates.as_ref()))
            + &table_html("", &budgets(&report.budgets), &[]);
        sections.push(("budgets", BUDGETS, html));
    }
    if !report.elisions.is_empty() {
        let reading = "<p>What a frame does not need is not drawn. Each picture was drawn a second \
                       time with something in it, to no effect, that makes all of it be drawn; both \
                       by turns.</p>\n";
        let html = reading.to_owned() + &table_html("", &elisions(&report.elisions), &[]);
        sections.push(("elisions", "Skipped work", html));
    }
    if !report.orders.is_empty() {
        let reading = "<p>In which order rays meet splashes (S) and aggregates (A) at their first \
                       two interfaces, of the rays that have two (Imai et al. 2016).</p>\n";
        sections.push((
            "orders",
            "Orders",
            reading.to_owned() + &table_html("", &orders(&report.orders), &[]),
        ));
    }
    if !report.stress.is_empty() {
        let reading = "<p>Scenes at the ends of what may be asked. Every pixel must be finite; the \
                       error is the mean absolute difference of radiance from the truth.</p>\n";
        let html = reading.to_owned() + &table_html("", &stress(&report.stress), &[]);
        sections.push(("stress", "Extreme scenes", html));
    }
    if !report.figures.is_empty() {
        let reading = "<p>The first of each row is the truth. A click shows a picture in full size; \
                       then ← and → alternate it with its neighbours.</p>\n";
        sections.push(("figures", "Side by side", reading.to_owned() + &pictures(&report.figures)));
    }
    sections
}

/// Renders the report as a single file, with its plots and pictures embedded.
pub fn html(report: &Report) -> String {
    let sections = sections(report);
    let adapter = escape(&report.adapter);
    let (command, form) = match report.quick {
        true => {
            ("limpid report --quick", " This is the short form: less is measured, and less often.")
        }
        false => ("limpid report", ""),
    };
    let mut html = format!(
        "<p>Measured on {adapter}.{form} To measure your own device: \
         <code>{command}</code></p>\n{READING}<nav>"
    );
    for (id, title, _) in &sections {
        html += &format!("<a href=\"#{id}\">{title}</a>");
    }
    html += "</nav>\n";
    for (id, title, content) in &sections {
        html += &format!("<section id=\"{id}\">\n<h2>{title}</h2>\n{content}</section>\n");
    }
    let script = (!report.figures.is_empty()).then_some(SCRIPT);
    page("limpid: speed against error", STYLE, &html, script)
}

#[cfg(test)]
mod tests {
    use super::super::sample::{empty, sample};
    use super::*;
    use crate::html_shell::tests::assert_self_contained;

    /// The page loads no external resource, and all text is escaped.
    #[test]
    fn self_contained_and_escaped() {
        let mut report = sample();
        report.figures[0].title = "<script src=x>\"'".into();
        report.orders[0].scene = "<b>".into();
        let page = html(&report);
        assert_self_contained(&page, 4);
        for absent in ["<i>", "<b>", "<up>"] {
            assert!(!page.contains(absent), "{absent}");
        }
        assert!(page.contains("made &lt;up&gt;") && page.contains("&lt;i&gt;"));
    }

    /// A section exists exactly if it has rows.
    #[test]
    fn sections_have_rows() {
        let full = sample();
        let ids = |report: &Report| -> Vec<&str> {
            sections(report).into_iter().map(|section| section.0).collect()
        };
        assert_eq!(ids(&empty()), [] as [&str; 0]);
        assert!(html(&empty()).contains("</html>"));
        let all = [
            "intersectors",
            "smoothing",
            "caustics",
            "pictures",
            "passes",
            "budgets",
            "elisions",
            "orders",
            "stress",
            "figures",
        ];
        assert_eq!(ids(&full), all);
        for (kind, id) in KINDS.map(|kind| (kind.0, kind.1)) {
            let rows = full.rows.iter().filter(|row| row.kind == kind).cloned().collect();
            let report = Report { rows, ..empty() };
            assert_eq!(ids(&report), [id]);
            assert_eq!(html(&report).matches("<section").count(), 1);
        }
    }

    /// Rows with hardly any figures, non-finite figures and empty pictures do not break the page.
    #[test]
    fn incomplete_and_non_finite_rows() {
        let mut report = empty();
        for (kind, ..) in KINDS {
            report.rows.push(Row::new(kind, "", "", ""));
            for number in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e300] {
                let row = Row {
                    solved_of_solvable: Some(number),
                    iterations: Some(number),
                    ..Row::new(kind, "s", "newton", &format!("iterations={}", report.rows.len()))
                };
                report.rows.push(row.timed(&[number]).with_error(number, ErrorKind::RaysWrong, ""));
            }
        }
        let panels = vec![("nothing".into(), RgbImage::new(0, 0))];
        report.figures.push(Figure { title: "t".into(), scene: "s".into(), panels });
        let page = html(&report);
        assert!(!page.contains("NaN"));
        assert!(page.matches("<svg").count() >= 4);
        for svg in page.split("<svg").skip(1) {
            assert!(!svg[..svg.find("</svg>").unwrap()].contains("inf"));
        }
    }

    /// Convergence plots have a point per iteration and share, joined in the order of iterations.
    #[test]
    fn convergence_lines_follow_iterations() {
        let mut report = sample();
        report.rows.reverse();
        let rows: Vec<&Row> = report.rows.iter().filter(|r| r.scene == "pool").collect();
        let plots = convergence_plots(&rows);
        assert_eq!(plots.len(), 1);
        assert_eq!(plots[0].lines, [(0..8).collect::<Vec<_>>(), (8..16).collect()]);
        let x: Vec<f64> = plots[0].points[..8].iter().map(|point| point.x).collect();
        assert_eq!(x, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        assert!(plots[0].points[..8].windows(2).all(|pair| pair[1].y < pair[0].y));
        let speed = speed_plots(&rows);
        assert_eq!(speed[0].lines[0].len(), 8);
        assert!(speed[0].points.iter().any(|point| point.label == "guarded" && point.ours));
    }
}
