//! The check report as a self-contained HTML page.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use quick_xml::escape::escape;

use super::{Exhibit, Measure, Outcome, Report, Verdict, digits};
use crate::html_shell;

const STYLE: &str = "
:root { --bad: #b3261e; --good: #2e7d32 }
@media (prefers-color-scheme: dark) { :root { --bad: #ff8a80; --good: #81c784 } }
h2 { font-size: 1.35rem; margin: 3rem 0 .5rem; padding-top: .7rem; border-top: 1px solid var(--line) }
h3 { font-size: 1rem; font-weight: 600; margin: 1.4rem 0 .3rem }
p, ul { max-width: 46rem; margin: .6rem 0 }
ul { padding-left: 1.2rem }
.dim, figcaption { color: var(--dim) }
.failed, .error { color: var(--bad); font-weight: 600 }
.passed { color: var(--good) }
.blessed { color: var(--accent) }
th, td { text-align: left; padding: .22rem 1.1rem .22rem 0; vertical-align: baseline }
th { font-weight: 500; color: var(--dim); border-bottom: 1px solid var(--line) }
.number { text-align: right; white-space: nowrap }
figcaption { font-size: .85rem; margin: .2rem 0 }
.panels { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 15rem), 1fr));
  gap: .6rem }
.panels img { display: block; width: 100%; height: auto; image-rendering: pixelated }
dialog img { display: block; image-rendering: pixelated;
  width: min(96vw, calc(88vh * var(--aspect))); height: auto }
dialog p { margin: .3rem .6rem; font-size: .85rem; max-width: none }
";

/// Shows a picture as large as the window on click; the arrow keys switch to its neighbours in
/// place.
const SCRIPT: &str = "
const dialog = document.querySelector('dialog'), [picture, caption] = dialog.children;
let shown;
const show = button => {
  if (!button) return;
  shown = button.parentElement;
  const image = button.firstElementChild;
  picture.src = image.src;
  picture.style.setProperty('--aspect', image.getAttribute('width') / image.getAttribute('height'));
  caption.textContent = shown.lastElementChild.textContent;
  if (!dialog.open) dialog.showModal();
};
document.addEventListener('click', event =>
  dialog.open ? dialog.close() : show(event.target.closest('.panels button')));
dialog.addEventListener('keydown', event => {
  if (event.key == 'ArrowRight') show(shown.nextElementSibling?.firstElementChild);
  if (event.key == 'ArrowLeft') show(shown.previousElementSibling?.firstElementChild);
});
";

/// Renders the report as a page.
pub(super) fn page(report: &Report) -> String {
    let name = report.suite.file_name().unwrap_or_default().to_string_lossy();
    let title = format!("limpid check {}", escape(&*name));
    let counts: Vec<String> = [
        (Verdict::Passed, "passed"),
        (Verdict::Failed, "failed"),
        (Verdict::Error, "could not be compared"),
        (Verdict::Blessed, "blessed"),
    ]
    .into_iter()
    .filter_map(|(verdict, word)| match report.count(verdict) {
        0 => None,
        count => Some(format!("<span class=\"{}\">{count} {word}</span>", class(verdict))),
    })
    .collect();
    let mut html = format!(
        "<p>{}. Drawn in {:.1} s on {}, limpid {}.</p>\n",
        counts.join(", "),
        report.seconds,
        escape(report.adapter.to_string()),
        env!("CARGO_PKG_VERSION"),
    );
    if report.outcomes.iter().any(|o| !o.blessing.is_empty() && !o.blessed) {
        let command = report.bless_command();
        html += &format!(
            "<p>To make what was drawn the expectation of what failed: <code>{}</code></p>\n",
            escape(&command)
        );
    }
    html += &summary(report);
    let shown = |outcome: &&Outcome| outcome.verdict() != Verdict::Passed;
    report.outcomes.iter().filter(shown).for_each(|outcome| html += &section(outcome));
    let pictures = report.outcomes.iter().any(|outcome| !outcome.exhibits.is_empty());
    html_shell::page(&title, STYLE, &html, pictures.then_some(SCRIPT))
}

fn class(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Passed => "passed",
        Verdict::Failed => "failed",
        Verdict::Error => "error",
        Verdict::Blessed => "blessed",
    }
}

/// A table with a row per entry; entries that did not pass link to their section.
fn summary(report: &Report) -> String {
    let mut html = String::from(
        "<div class=\"wide\"><table>\n<tr><th>entry</th><th></th><th class=\"number\">mean FLIP</th>\
         <th class=\"number\">99th percentile</th><th class=\"number\">greatest channel error</th>\
         <th class=\"number\">s</th></tr>\n",
    );
    for outcome in &report.outcomes {
        let verdict = outcome.verdict();
        let name = escape(&outcome.name);
        let name = match verdict {
            Verdict::Passed => name.into_owned(),
            _ => format!("<a href=\"#{name}\">{name}</a>"),
        };
        html += &format!("<tr><td>{name}</td><td class=\"{0}\">{0}</td>", class(verdict));
        // The first three measures are those of the picture, if there was one to compare with.
        let pictured = outcome.measures.first().is_some_and(|m| m.name == super::judge::MEAN_FLIP);
        for i in 0..3 {
            let value = outcome.measures.get(i).filter(|_| pictured);
            let class = if value.is_some_and(|m| !m.passes()) { "number failed" } else { "number" };
            let value = value.map_or("\u{2013}".into(), |measure| digits(measure.value));
            html += &format!("<td class=\"{class}\">{value}</td>");
        }
        html += &format!("<td class=\"number\">{:.1}</td></tr>\n", outcome.seconds);
    }
    html + "</table></div>\n"
}

fn section(outcome: &Outcome) -> String {
    let name = escape(&outcome.name);
    let verdict = class(outcome.verdict());
    let mut html = format!(
        "<section id=\"{name}\">\n<h2>{name} <span class=\"{verdict}\">{verdict}</span></h2>\n<ul>\n"
    );
    for reason in outcome.reasons() {
        html += &format!("<li>{}</li>\n", escape(&reason));
    }
    html += "</ul>\n";
    if !outcome.measures.is_empty() {
        html += "<div class=\"wide\"><table>\n<tr><th>measured</th><th class=\"number\">value</th>\
                 <th class=\"number\">allowed</th><th></th></tr>\n";
        outcome.measures.iter().for_each(|measure| html += &row(measure));
        html += "</table></div>\n";
    }
    outcome.exhibits.iter().for_each(|exhibit| html += &panels(exhibit));
    html + "</section>\n"
}

fn row(measure: &Measure) -> String {
    let Measure { name, value, at_most, at_least, unit } = measure;
    let allowed = match *at_least {
        0.0 => digits(*at_most),
        least => format!("{} to {}", digits(least), digits(*at_most)),
    };
    let class = if measure.passes() { "number" } else { "number failed" };
    let (name, value) = (escape(name), digits(*value));
    format!(
        "<tr><td>{name}</td><td class=\"{class}\">{value}</td>\
         <td class=\"number\">{allowed}</td><td>{unit}</td></tr>\n"
    )
}

fn panels(exhibit: &Exhibit) -> String {
    let title = escape(&exhibit.title);
    let mut html = format!("<h3>{title}</h3>\n<div class=\"panels\">\n");
    for panel in &exhibit.panels {
        let (caption, (width, height)) = (panel.caption, panel.size);
        let data = STANDARD.encode(&panel.png);
        html += &format!(
            "<figure><button type=\"button\"><img src=\"data:image/png;base64,{data}\" \
             alt=\"{caption}\" width=\"{width}\" height=\"{height}\"></button>\
             <figcaption>{caption}</figcaption></figure>\n"
        );
    }
    html + "</div>\n"
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::Adapter;
    use super::*;
    use crate::html_shell::tests::assert_self_contained;
    use image::RgbImage;
    use limpid_io::error::Error;
    use limpid_io::output::Files;

    /// A report with one entry that passed, one that failed and one that could not be compared.
    pub(in super::super) fn sample() -> Report {
        let mut good = Outcome::new("good");
        good.measured(Measure::new(super::super::judge::MEAN_FLIP, 0.0, 0.01, ""));
        let mut bad = Outcome::new("bad");
        bad.measured(Measure::new(super::super::judge::MEAN_FLIP, 0.5, 0.01, ""));
        let picture = RgbImage::new(4, 3);
        let pictures = [("expected", &picture), ("actual", &picture)];
        bad.exhibits.push(Exhibit::new("bad", "the picture", &pictures));
        bad.blessing.push(("bad.png".into(), vec![0].into()));
        let mut wrong = Outcome::new("wrong");
        wrong.error = Some(Error::Mismatch("a.png: 4x4 pixels".into()));
        let adapter = Adapter { name: "a".into(), driver: "d".into(), backend: "vulkan".into() };
        let outcomes = vec![good, bad, wrong];
        let (suite, files) = ("tests/limpid.toml".into(), Files::default());
        Report { suite, adapter, outcomes, seconds: 1.0, files }
    }

    /// The page loads no external resource, escapes all text, and closes every element.
    #[test]
    fn self_contained_and_escaped() {
        let mut report = sample();
        report.outcomes[1].problems.push("<script src=x>\"'".into());
        report.adapter.name = "<i>".into();
        report.suite = "<b>.toml".into();
        let page = page(&report);
        // Two pictures, and the dialog's.
        assert_self_contained(&page, 3);
        assert!(!page.contains("<i>") && !page.contains("<b>"));
    }

    /// Passed entries get a row only, others a section; the bless command is shown only if
    /// something can be blessed.
    #[test]
    fn only_failures_have_sections() {
        let report = sample();
        let html = page(&report);
        assert_eq!(html.matches("<section").count(), 2);
        assert!(html.contains("limpid check tests/limpid.toml --bless"));
        let passed = Report { outcomes: vec![Outcome::new("good")], ..report };
        let html = page(&passed);
        assert!(!html.contains("<section") && !html.contains("--bless"), "{html}");
        assert!(html.contains("1 passed"));
    }
}
