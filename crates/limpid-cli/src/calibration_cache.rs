//! Calibrations of `--max-error` and `--budget`, kept in the user's cache folder so that the next run need
//! not measure.
//!
//! A file for each adapter and size holds the cost of each choice of settings. It names limpid's version, the
//! driver and the curve that it is of; one of others, or that cannot be read, is ignored and replaced. No
//! failure is an error: a run without the cache measures.

use std::hash::Hasher as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use glam::UVec2;
use limpid::gpu::Gpu;
use limpid_io::output::{self, FileKind};
use limpid_io::quality::{Curve, List};
use serde::{Deserialize, Serialize};
use siphasher::sip128::{Hasher128 as _, SipHasher24};

use crate::pipeline_cache::{self, Identity};

/// Largest accepted file, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Costs by which a choice may differ from the defaults; others are damage.
const COSTS: std::ops::RangeInclusive<f64> = 1e-4..=1e4;

/// First line of a file.
const HEADER: &str = "\
# Time of a frame with each choice of settings over that with limpid's defaults, measured by `limpid render`.
# To measure anew: --calibrate, or delete this file.
";

/// The calibrations of one adapter at one size.
pub(crate) struct CalibrationCache {
    path: PathBuf,
    stored: Stored,
}

/// The contents of a file.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    /// Identity of the program and the adapter that the costs depend on.
    of: String,
    /// Costs of the curve's lists, if they have been measured.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    intersectors: Vec<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pictures: Vec<f64>,
}

impl CalibrationCache {
    /// Opens the calibrations of an adapter and a size; `None` if there is no cache folder.
    pub(crate) fn open(gpu: &Gpu, curve: &Curve, size: UVec2) -> Option<Self> {
        Some(Self::within(&output::cache_folder()?, &Identity::of(&gpu.device), curve, size))
    }

    fn within(folder: &Path, identity: &Identity, curve: &Curve, size: UVec2) -> Self {
        let Identity { adapter, compiler } = identity;
        let path = folder.join(format!("calibration-{adapter}-{}x{}.toml", size.x, size.y));
        let of = format!("{compiler}; {}x{}; curve {:032x}", size.x, size.y, hash(curve));
        let stored = read(&path).filter(|stored| stored.of == of && stored.is_of(curve));
        Self { path, stored: stored.unwrap_or(Stored { of, ..Stored::default() }) }
    }

    /// The costs of a list's choices, if they have been measured.
    pub(crate) fn costs(&self, list: List) -> Option<Vec<f64>> {
        let costs = self.stored.list(list);
        (!costs.is_empty()).then(|| costs.to_vec())
    }

    /// Keeps the costs of a list's choices.
    pub(crate) fn keep(&mut self, list: List, costs: &[f64]) {
        match list {
            List::Intersectors => self.stored.intersectors = costs.to_vec(),
            List::Pictures => self.stored.pictures = costs.to_vec(),
        }
        let Ok(text) = toml::to_string(&self.stored) else { return };
        // If the file cannot be written, the next run measures.
        let Some(Ok(())) = self.path.parent().map(pipeline_cache::create_folder) else { return };
        let _ = output::write_atomically(&self.path, FileKind::CACHE, |file| {
            file.write_all(HEADER.as_bytes())?;
            file.write_all(text.as_bytes())
        });
    }
}

impl Stored {
    fn list(&self, list: List) -> &[f64] {
        match list {
            List::Intersectors => &self.intersectors,
            List::Pictures => &self.pictures,
        }
    }

    /// Whether each list has a cost for each choice, the first of which are the defaults, or is empty.
    fn is_of(&self, curve: &Curve) -> bool {
        [List::Intersectors, List::Pictures].into_iter().all(|list| match self.list(list) {
            [] => true,
            costs => {
                costs.len() == curve.choices(list).len()
                    && costs[0] == 1.0
                    && costs.iter().all(|cost| COSTS.contains(cost))
            }
        })
    }
}

fn read(path: &Path) -> Option<Stored> {
    let mut bytes = Vec::new();
    limpid_io::files::read(path, |_| MAX_BYTES, &mut bytes).ok()?;
    toml::from_str(std::str::from_utf8(&bytes).ok()?).ok()
}

/// Identifies the choices, their order and their errors.
fn hash(curve: &Curve) -> u128 {
    let mut hasher = SipHasher24::new();
    hasher.write(format!("{curve:?}").as_bytes());
    hasher.finish128().as_u128()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: UVec2 = UVec2::new(640, 480);

    fn identity(driver: &str) -> Identity {
        Identity { adapter: "vulkan-1-2".into(), compiler: format!("limpid 1, {driver}") }
    }

    /// Costs of a list, all different.
    fn costs(list: List) -> Vec<f64> {
        let count = Curve::shipped().choices(list).len();
        (0..count).map(|i| 1.0 / (1.0 + 0.1 * i as f64)).collect()
    }

    fn open(folder: &Path) -> CalibrationCache {
        CalibrationCache::within(folder, &identity("driver 1"), Curve::shipped(), SIZE)
    }

    /// Costs come back bit for bit, each list's own; lists that were not measured do not.
    #[test]
    fn costs_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        // The folder is made.
        let folder = folder.path().join("cache/limpid");
        let mut cache = open(&folder);
        assert_eq!(cache.costs(List::Pictures), None);
        cache.keep(List::Pictures, &costs(List::Pictures));
        let mut again = open(&folder);
        assert_eq!(again.costs(List::Pictures), Some(costs(List::Pictures)));
        assert_eq!(again.costs(List::Intersectors), None);
        again.keep(List::Intersectors, &costs(List::Intersectors));
        let again = open(&folder);
        assert_eq!(again.costs(List::Pictures), Some(costs(List::Pictures)));
        assert_eq!(again.costs(List::Intersectors), Some(costs(List::Intersectors)));
        let names: Vec<_> = folder.read_dir().unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(names, ["calibration-vulkan-1-2-640x480.toml"], "and no temporary file");
    }

    /// Costs of another size, adapter, driver or curve are not used, and give way to new ones.
    #[test]
    fn costs_of_others_are_not_used() {
        let folder = tempfile::tempdir().unwrap();
        let (folder, curve) = (folder.path(), Curve::shipped());
        open(folder).keep(List::Pictures, &costs(List::Pictures));
        assert!(open(folder).costs(List::Pictures).is_some());

        let pictures = |cache: CalibrationCache| cache.costs(List::Pictures);
        let own = identity("driver 1");
        let wide = UVec2::new(1280, 480);
        assert_eq!(pictures(CalibrationCache::within(folder, &own, curve, wide)), None);
        let adapter = Identity { adapter: "vulkan-1-3".into(), ..identity("driver 1") };
        assert_eq!(pictures(CalibrationCache::within(folder, &adapter, curve, SIZE)), None);
        let mut other = curve.clone();
        other.pictures[1].flip += 1e-3;
        assert_eq!(pictures(CalibrationCache::within(folder, &own, &other, SIZE)), None);
        let mut driver = CalibrationCache::within(folder, &identity("driver 2"), curve, SIZE);
        assert_eq!(driver.costs(List::Pictures), None);
        // Of the same adapter: it takes the file's place.
        driver.keep(List::Pictures, &costs(List::Pictures));
        assert_eq!(open(folder).costs(List::Pictures), None);
    }

    /// A damaged file is ignored, whatever the damage, and replaced.
    #[test]
    fn damaged_files_are_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let mut cache = open(folder);
        let path = cache.path.clone();
        cache.keep(List::Pictures, &costs(List::Pictures));
        let whole = std::fs::read_to_string(&path).unwrap();
        let second = format!("{}", costs(List::Pictures)[1]);
        let damages = [
            String::new(),
            "\0\u{7f}".into(),
            whole[..whole.len() / 2].into(),
            whole.replace(&second, "nan"),
            whole.replace(&second, "-1.0"),
            whole.replace(&second, "1e300"),
            whole.replace("[1.0,", "[2.0,").replace("    1.0,\n", "    2.0,\n"),
            whole.replace(&format!("{second},"), ""),
            whole.clone() + "more = 1\n",
        ];
        for (number, damage) in damages.iter().enumerate() {
            assert_ne!(damage, &whole, "{number}");
            std::fs::write(&path, damage).unwrap();
            assert_eq!(open(folder).costs(List::Pictures), None, "{number}: {damage}");
            open(folder).keep(List::Pictures, &costs(List::Pictures));
            assert_eq!(std::fs::read_to_string(&path).unwrap(), whole, "{number}");
        }
    }
}
