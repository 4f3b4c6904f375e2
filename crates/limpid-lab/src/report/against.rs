//! Comparison of error figures with those of an earlier report: regressions.

use std::collections::HashMap;
use std::fmt;
use std::path::Path;

use serde::Deserialize;

use super::Report;
use super::rows::{Row, Stress};
use limpid_io::error::{Error, Result};
use limpid_io::files;

/// Relative increase of a figure that counts as rounding: the same mathematics in other machine
/// code.
pub const TOLERANCE: f64 = 0.01;

/// Maximum number of figures that are listed.
const SHOWN: usize = 20;

/// The comparison of two reports: the error figures of rows and of extreme scenes.
#[derive(Debug, Clone, PartialEq)]
pub struct Against {
    /// Figures in both reports.
    pub figures: usize,
    /// Of these, bit-identical ones.
    pub same: usize,
    /// Of these, smaller than before.
    pub better: usize,
    /// Figures in only one report.
    pub alone: usize,
    /// Figures larger than before, the largest relative increase first.
    pub worse: Vec<Change>,
}

/// A figure larger than before.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Kind of row, scene, method, settings and measure.
    pub name: String,
    /// The value in the earlier report.
    pub before: f64,
    /// The value in this report.
    pub after: f64,
}

/// The measurements in a report's JSON.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
pub struct Measured {
    rows: Vec<Row>,
    stress: Vec<Stress>,
}

impl Measured {
    /// Reads the JSON of a report.
    ///
    /// # Errors
    /// [`Error::Io`] if it cannot be read, [`Error::Format`] if it is not a report.
    pub fn read(path: &Path) -> Result<Self> {
        let text = files::read_text(path)?;
        serde_json::from_str(&text)
            .map_err(|e| Error::format(path, format!("not the JSON of a report: {e}")))
    }

    /// Extracts the measurements of a report.
    pub fn of(report: &Report) -> Self {
        Self { rows: report.rows.clone(), stress: report.stress.clone() }
    }

    /// Figures by name; smaller is better for all of them.
    fn figures(&self) -> HashMap<String, f64> {
        let mut figures = HashMap::new();
        for row in &self.rows {
            let Row { kind, scene, method, settings, error_kind, .. } = row;
            let name = format!("{kind:?} {scene} {method} {settings}");
            if let (Some(error), Some(kind)) = (row.error, error_kind) {
                figures.insert(format!("{name}: {kind:?}"), error);
            }
            // Rows of one method that differ only in their error kind repeat the other figures.
            if let Some(pixels) = row.rms_px {
                figures.insert(format!("{name}: RmsPixels"), pixels);
            }
        }
        for Stress { case, median_error, worst_error, not_finite, .. } in &self.stress {
            figures.insert(format!("Stress {case}: MedianError"), *median_error);
            figures.insert(format!("Stress {case}: WorstError"), *worst_error);
            figures.insert(format!("Stress {case}: NotFinite"), *not_finite as f64);
        }
        figures
    }

    /// Compares with earlier measurements.
    pub fn against(&self, earlier: &Self) -> Against {
        let (before, after) = (earlier.figures(), self.figures());
        let both = after.iter().filter_map(|(name, &a)| Some((name, *before.get(name)?, a)));
        let (mut figures, mut same, mut better, mut worse) = (0, 0, 0, Vec::new());
        for (name, before, after) in both {
            figures += 1;
            if before.to_bits() == after.to_bits() {
                same += 1;
            } else if after < before {
                better += 1;
            } else {
                // NaN is worse than any number.
                worse.push(Change { name: name.clone(), before, after });
            }
        }
        worse.sort_by(|a, b| b.risen().total_cmp(&a.risen()).then_with(|| a.name.cmp(&b.name)));
        let alone = before.len() + after.len() - 2 * figures;
        Against { figures, same, better, alone, worse }
    }
}

impl Change {
    /// Relative increase of the figure; infinite if it was 0 or the result is NaN.
    pub fn risen(&self) -> f64 {
        let risen = (self.after - self.before) / self.before;
        if risen.is_nan() { f64::INFINITY } else { risen }
    }
}

impl Against {
    /// The figures that have increased by more than [`TOLERANCE`].
    pub fn risen(&self) -> impl Iterator<Item = &Change> {
        self.worse.iter().take_while(|change| change.risen() > TOLERANCE)
    }
}

impl fmt::Display for Against {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { figures, same, better, alone, worse } = self;
        write!(
            f,
            "{figures} error figures in both reports, {alone} in one alone: {same} the same, "
        )?;
        write!(f, "{better} better, {} worse", worse.len())?;
        let risen = self.risen().count();
        write!(f, ", {risen} of them by more than {} %", 100.0 * TOLERANCE)?;
        // At least the worst, even if it is below the tolerance.
        for change in worse.iter().take(risen.clamp(1, SHOWN)) {
            let Change { name, before, after } = change;
            let risen = 100.0 * change.risen();
            write!(f, "\n  {name}: {before:.3e} -> {after:.3e} ({risen:+.2} %)")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::rows::{ErrorKind, RowKind};
    use super::*;

    fn measured(error: f64, pixels: f64, not_finite: u64) -> Measured {
        let mut row = Row::new(RowKind::Intersect, "pool", "march", "stride=1").with_error(
            error,
            ErrorKind::RaysWrong,
            "truth",
        );
        row.rms_px = Some(pixels);
        let flip = Row::new(RowKind::Picture, "pool", "limpid", "").with_error(
            0.1,
            ErrorKind::MeanFlip,
            "truth",
        );
        let stress = Stress {
            case: "scale".into(),
            pictures: 3,
            not_finite,
            median_error: 1e-3,
            worst_error: 2e-3,
            worst: String::new(),
        };
        Measured { rows: vec![row, flip], stress: vec![stress] }
    }

    /// Increased figures are listed, the largest increase first; rounding does not count as an
    /// increase, a picture that is no longer finite does.
    #[test]
    fn regressions_are_listed() {
        let before = measured(0.02, 1e-5, 0);
        let same = before.against(&before);
        assert_eq!((same.figures, same.same, same.alone), (6, 6, 0));
        assert_eq!(same.risen().count(), 0);

        let rounded = measured(0.02 * 1.001, 0.9e-5, 0).against(&before);
        assert_eq!((rounded.same, rounded.better, rounded.worse.len()), (4, 1, 1));
        assert_eq!(rounded.risen().count(), 0);

        let worse = measured(0.03, 1e-5 * 1.02, 1).against(&before);
        let names: Vec<_> = worse.risen().map(|change| change.name.as_str()).collect();
        let expected = [
            "Stress scale: NotFinite",
            "Intersect pool march stride=1: RaysWrong",
            "Intersect pool march stride=1: RmsPixels",
        ];
        assert_eq!(names, expected);
        let text = worse.to_string();
        assert!(text.contains("3 worse, 3 of them by more than 1 %"), "{text}");
        assert!(text.contains("RaysWrong: 2.000e-2 -> 3.000e-2 (+50.00 %)"), "{text}");

        let undefined = measured(f64::NAN, 1e-5, 0).against(&before);
        assert_eq!(undefined.risen().count(), 1);

        let mut fewer = before.clone();
        fewer.rows.pop();
        assert_eq!(fewer.against(&before).alone, 1);
    }

    /// A written report is read back; a file that is not a report is rejected by name.
    #[test]
    fn reports_round_trip() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("report.json");
        let report = super::super::sample::sample();
        std::fs::write(&path, serde_json::to_string(&report).expect("JSON")).expect("written");
        let read = Measured::read(&path).expect("a report");
        assert_eq!(read, Measured::of(&report));
        std::fs::write(&path, "{\"rows\": 3}").expect("written");
        let refused = Measured::read(&path).expect_err("no report").to_string();
        assert!(refused.contains("report.json") && refused.contains("not the JSON"), "{refused}");
    }
}
