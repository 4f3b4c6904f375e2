//! Tables, as Markdown for a README and as rows of text for the HTML page.

use super::elisions::Elision;
use super::passes::Budget;
use super::rates::Rates;
use super::{ErrorKind, Orders, Report, Row, RowKind, Stress};

/// A table: column names, whether columns are numeric, and the rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Table {
    pub(super) head: Vec<(&'static str, bool)>,
    pub(super) rows: Vec<Vec<String>>,
}

/// Kinds of rows with the id and the title of their section.
pub(super) const KINDS: [(RowKind, &str, &str); 5] = [
    (RowKind::Intersect, "intersectors", "Intersectors"),
    (RowKind::Smooth, "smoothing", "Smoothing"),
    (RowKind::Caustics, "caustics", "Caustics"),
    (RowKind::Picture, "pictures", "Pictures"),
    (RowKind::Pass, "passes", "Passes"),
];

/// The title of the budgets.
pub(super) const BUDGETS: &str = "Budgets";

/// Formats a number with three significant digits, without an exponent for moderate magnitudes.
pub(super) fn significant(value: f64) -> String {
    if !value.is_finite() {
        return "–".into();
    }
    let rounded = format!("{value:.2e}");
    let exponent: i32 = rounded.split('e').nth(1).and_then(|e| e.parse().ok()).unwrap_or(0);
    match exponent {
        _ if value == 0.0 => "0".into(),
        -4..=2 => format!("{value:.*}", (2 - exponent) as usize),
        3..=5 => format!("{value:.0}"),
        _ => rounded,
    }
}

/// Formats a share in per cent, with enough digits to distinguish it from 100 %.
pub(super) fn percent(share: f64) -> String {
    let missing = 100.0 * (1.0 - share);
    if missing == 0.0 {
        "100".into()
    } else if share > 0.5 && missing > 0.0 {
        let digits = (1.0 - missing.log10().floor()).clamp(1.0, 8.0) as usize;
        format!("{:.digits$}", 100.0 * share)
    } else {
        significant(100.0 * share)
    }
}

/// The short name of an error.
pub(super) fn error_name(kind: ErrorKind) -> &'static str {
    match kind {
        ErrorKind::RaysWrong => "rays wrong",
        ErrorKind::NormalMedianDegrees => "normals, median error, °",
        ErrorKind::NormalP90Degrees => "normals, 90 % within, °",
        ErrorKind::DepthRmsAllRadii => "depth, RMS, radii",
        ErrorKind::DepthRmsNineTenthsRadii => "depth, RMS without the worst tenth, radii",
        ErrorKind::MeanFlip => "mean FLIP",
        ErrorKind::FlipOfLiquid => "FLIP of the liquid",
        ErrorKind::FlipOneInterval => "FLIP, one interval",
        ErrorKind::FlipSeveralIntervals => "FLIP, several intervals",
        ErrorKind::ChangeInOrbit => "change in orbit, × truth's",
        ErrorKind::ChangeInPlay => "change in play, × truth's",
        ErrorKind::RelativeL1 => "relative L1",
        ErrorKind::RelativeL1OnePath => "relative L1, one path",
    }
}

/// Collects the distinct keys of rows in order of appearance.
pub(super) fn distinct<'a, T: PartialEq>(rows: &[&'a Row], key: impl Fn(&'a Row) -> T) -> Vec<T> {
    let mut keys = Vec::new();
    for key in rows.iter().map(|row| key(row)) {
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    keys
}

/// A column: its name, whether it is numeric, whether brief tables include it, and its cells.
type Column = (&'static str, bool, bool, fn(&Row) -> Option<String>);

const COLUMNS: [Column; 14] = [
    ("scene", false, true, |row| text(&row.scene)),
    ("method", false, true, |row| text(&row.method)),
    ("settings", false, true, |row| text(&row.settings)),
    ("ms", true, true, |row| row.ms.map(significant)),
    ("±", true, false, |row| row.ms_spread.map(significant)),
    ("fetches", true, true, |row| row.fetches.map(significant)),
    ("iterations", true, false, |row| row.iterations.map(significant)),
    ("RMS, px", true, false, |row| row.rms_px.map(significant)),
    ("solved of all, %", true, false, |row| row.solved_of_all.map(percent)),
    ("solved of solvable, %", true, true, |row| row.solved_of_solvable.map(percent)),
    ("wrong accepts, %", true, true, |row| row.wrong_accepts.map(percent)),
    ("light kept, %", true, true, |row| row.light_kept.map(percent)),
    ("several paths, %", true, false, |row| row.several_paths.map(percent)),
    ("several intervals, %", true, true, |row| row.several_intervals.map(percent)),
];

fn text(text: &str) -> Option<String> {
    (!text.is_empty()).then(|| text.to_owned())
}

/// Tabulates rows of one kind. Rows that differ only in their error kind are merged, with a column
/// per error; empty columns are omitted, and details too if `brief`.
pub(super) fn measurements(rows: &[&Row], brief: bool) -> Table {
    let mut groups: Vec<Vec<&Row>> = Vec::new();
    for &row in rows {
        let same = |group: &&mut Vec<&Row>| {
            let first = group[0];
            (&first.scene, &first.method, &first.settings)
                == (&row.scene, &row.method, &row.settings)
                && group.iter().all(|other| other.error_kind != row.error_kind)
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.push(row),
            None => groups.push(vec![row]),
        }
    }
    let mut table = Table { head: Vec::new(), rows: vec![Vec::new(); groups.len()] };
    let mut add = |name, number, cell: &dyn Fn(&Row) -> Option<String>| {
        let cells: Vec<Option<String>> =
            groups.iter().map(|group| group.iter().find_map(|row| cell(row))).collect();
        if cells.iter().any(Option::is_some) {
            table.head.push((name, number));
            for (row, cell) in table.rows.iter_mut().zip(cells) {
                row.push(cell.unwrap_or_default());
            }
        }
    };
    for (name, number, always, cell) in COLUMNS {
        if always || !brief {
            add(name, number, &cell);
        }
    }
    for kind in distinct(rows, |row| row.error_kind).into_iter().flatten() {
        let (name, format): (_, fn(f64) -> String) = match kind {
            ErrorKind::RaysWrong => ("rays wrong, %", percent),
            _ => (error_name(kind), significant),
        };
        add(name, true, &|row| (row.error_kind == Some(kind)).then(|| row.error.map(format))?);
    }
    // A truth shared by all rows is given once, above the table.
    if !brief && rows.iter().any(|row| row.truth != rows[0].truth) {
        add("truth", false, &|row| row.truth.clone());
    }
    table
}

/// Tabulates budgets.
pub(super) fn budgets(budgets: &[Budget]) -> Table {
    let names = ["scene", "size", "pass", "MB", "Mop", "floor, ms", "ms", "ms/floor"];
    let row = |b: &Budget| {
        let mega = |n: f64| significant(1e-6 * n);
        let number = |n: Option<f64>| n.map_or("not measured".into(), significant);
        let size = format!("{}×{}", b.size[0], b.size[1]);
        let [floor, ms, ratio] = [b.floor_ms, b.ms, b.ratio()].map(number);
        let name = [b.scene.clone(), size, b.pass.clone()];
        [&name[..], &[mega(b.bytes), mega(b.operations), floor, ms, ratio]].concat()
    };
    let head = names.map(|name| (name, !["scene", "size", "pass"].contains(&name))).to_vec();
    Table { head, rows: budgets.iter().map(row).collect() }
}

/// Describes the rates that the floors are computed with.
pub(super) fn rates(rates: Option<&Rates>) -> String {
    let Some(rates) = rates else { return "The adapter has no timestamps.".into() };
    let giga = |rate: f64| significant(1e-9 * rate);
    let (bytes, operations) = (giga(rates.bytes_per_s), giga(rates.operations_per_s));
    format!("The adapter copies {bytes} GB/s and multiplies and adds {operations} Gop/s.")
}

/// Tabulates elisions.
pub(super) fn elisions(elisions: &[Elision]) -> Table {
    let names = ["left out", "drawn by", "ms", "drawn, ms", "saved, %", "same picture"];
    let row = |e: &Elision| {
        let number = |n: Option<f64>| n.map_or("not measured".into(), significant);
        let saved = e.ms.zip(e.forced_ms).map(|(ms, forced)| 100.0 * (1.0 - ms / forced));
        let saved = saved.map_or("not measured".into(), |saved| format!("{saved:.0}"));
        let same = if e.same { "yes" } else { "no" };
        let (ms, forced) = (number(e.ms), number(e.forced_ms));
        vec![e.name.clone(), e.forced_by.clone(), ms, forced, saved, same.into()]
    };
    let text = ["left out", "drawn by", "same picture"];
    let head = names.map(|name| (name, !text.contains(&name))).to_vec();
    Table { head, rows: elisions.iter().map(row).collect() }
}

/// Tabulates the shares of orders.
pub(super) fn orders(orders: &[Orders]) -> Table {
    let names = ["scene", "SS, %", "SA, %", "AS, %", "AA, %"];
    let row = |o: &Orders| {
        let [ss, sa, as_, aa] = [o.ss, o.sa, o.as_, o.aa].map(percent);
        vec![o.scene.clone(), ss, sa, as_, aa]
    };
    let head = names.map(|name| (name, name != "scene")).to_vec();
    Table { head, rows: orders.iter().map(row).collect() }
}

/// Tabulates extreme scenes.
pub(super) fn stress(stress: &[Stress]) -> Table {
    let names = ["varied", "pictures", "pixels not finite", "error, median", "worst", "worst at"];
    let row = |s: &Stress| {
        let [median, worst] = [s.median_error, s.worst_error].map(significant);
        let (pictures, not_finite) = (s.pictures.to_string(), s.not_finite.to_string());
        vec![s.case.clone(), pictures, not_finite, median, worst, s.worst.clone()]
    };
    let head = names.map(|name| (name, !["varied", "worst at"].contains(&name))).to_vec();
    Table { head, rows: stress.iter().map(row).collect() }
}

/// The non-empty tables of a report with their titles.
fn tables(report: &Report) -> Vec<(&'static str, Table)> {
    let of = |kind| report.rows.iter().filter(|row| row.kind == kind).collect::<Vec<_>>();
    let kinds = KINDS.map(|(kind, _, title)| (title, measurements(&of(kind), true)));
    let others = [
        (BUDGETS, budgets(&report.budgets)),
        ("Skipped work", elisions(&report.elisions)),
        ("Orders", orders(&report.orders)),
        ("Extreme scenes", stress(&report.stress)),
    ];
    kinds.into_iter().chain(others).filter(|(_, table)| !table.rows.is_empty()).collect()
}

/// Renders the tables of a report as Markdown, for a README: one for each kind that has rows.
pub fn markdown(report: &Report) -> String {
    let escape = |text: &str| {
        let text = text.replace('\\', "\\\\").replace('|', "\\|").replace('<', "&lt;");
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let mut markdown = format!("Measured on {}.\n", escape(&report.adapter));
    for (title, table) in tables(report) {
        markdown += &format!("\n### {title}\n\n");
        if title == BUDGETS {
            markdown += &format!("{}\n\n", rates(report.rates.as_ref()));
        }
        markdown += &line(table.head.iter().map(|(name, _)| (*name).to_owned()).collect());
        let rules = table.head.iter().map(|(_, number)| if *number { "--:" } else { "---" });
        markdown += &line(rules.map(str::to_owned).collect());
        for row in &table.rows {
            markdown += &line(row.iter().map(|cell| escape(cell)).collect());
        }
    }
    markdown
}

#[cfg(test)]
mod tests {
    use super::super::sample::{empty, sample};
    use super::*;

    /// Rows have as many cells as their heads, whatever text they contain.
    #[test]
    fn cells_per_row() {
        let mut report = sample();
        report.rows[0].scene = "a|b\nc <d>\\".into();
        let text = markdown(&report);
        assert!(text.contains(r"a\|b c &lt;d>\\"), "{text}");
        let mut tables = 0;
        for block in text.split("\n\n").filter(|block| block.starts_with('|')) {
            let cells =
                |line: &str| line.replace("\\\\", "").replace("\\|", "").matches('|').count();
            let head = cells(block.lines().next().unwrap());
            assert!(block.lines().count() >= 3 && head >= 3, "{block}");
            assert!(block.lines().all(|line| cells(line) == head), "{block}");
            tables += 1;
        }
        assert_eq!(tables, 9);
        assert!(!markdown(&empty()).contains('|'));
    }

    /// The errors of one filter are columns of one row.
    #[test]
    fn errors_are_columns() {
        let report = sample();
        let rows: Vec<&Row> =
            report.rows.iter().filter(|row| row.kind == RowKind::Smooth).collect();
        let table = measurements(&rows, true);
        let names: Vec<&str> = table.head.iter().map(|column| column.0).collect();
        let errors = [
            "normals, median error, °",
            "normals, 90 % within, °",
            "depth, RMS, radii",
            "depth, RMS without the worst tenth, radii",
        ];
        assert_eq!(names[names.len() - 4..], errors);
        assert_eq!(table.rows.len() * 4, rows.len());
        assert!(table.rows.iter().all(|row| row[names.len() - 4..].iter().all(|c| !c.is_empty())));
    }

    /// Numbers have three significant digits, and no share below 100 % is rounded to 100 %.
    #[test]
    fn number_formats() {
        let texts =
            [0.0, 1.0, 9.999, 600.4, 12345.6, 0.01234, 1.5e-7, -2.5, f64::NAN].map(significant);
        assert_eq!(texts, ["0", "1.00", "10.0", "600", "12346", "0.0123", "1.50e-7", "-2.50", "–"]);
        let texts = [0.0, 1.0, 0.5, 0.99987, 0.9, 0.00123, 0.999, 1.2].map(percent);
        assert_eq!(texts, ["0", "100", "50.0", "99.987", "90.0", "0.123", "99.90", "120"]);
    }
}
