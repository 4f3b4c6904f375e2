//! Replacing the liquid's optics by name, as `--set` does with settings.

use glam::Vec3;

use super::Scene;
use crate::error::{Error, Result};

impl Scene {
    /// Whether an override is of the liquid's optics: `liquid.…` or `fluid.…`.
    pub fn is_optics(text: &str) -> bool {
        text.starts_with("liquid.") || text.starts_with("fluid.")
    }

    /// Replaces `liquid.ior=1.4`, `liquid.absorption=[1, 0.3, 0.1]`, or one fluid's, counted from
    /// 1: `fluid.2.absorption=[0, 0, 5]`.
    ///
    /// # Errors
    /// [`Error::Scene`] naming the override.
    pub fn set_optics(&mut self, text: &str) -> Result<()> {
        let fail = |problem: String| Error::Scene { origin: format!("--set {text}"), problem };
        let (key, value) =
            text.split_once('=').ok_or_else(|| fail("expected name=value".into()))?;
        let value: toml::Value = format!("v = {value}")
            .parse::<toml::Table>()
            .ok()
            .and_then(|mut table| table.remove("v"))
            .ok_or_else(|| fail("a number or three in brackets expected".into()))?;
        let bad = |e: toml::de::Error| fail(e.message().to_owned());
        let fluids = self.fluids.len();
        match key.trim().split('.').collect::<Vec<_>>()[..] {
            ["liquid", "ior"] => self.liquid.ior = value.try_into().map_err(bad)?,
            ["liquid", "absorption"] => self.liquid.absorption = vector(value).map_err(bad)?,
            ["fluid", number, "absorption"] => {
                let index = number.parse::<usize>().ok().and_then(|n| n.checked_sub(1));
                let fluid = index.and_then(|i| self.fluids.get_mut(i));
                let problem = format!("no fluid {number}; the scene has {fluids}");
                fluid.ok_or_else(|| fail(problem))?.absorption = vector(value).map_err(bad)?;
            }
            _ => {
                let problem = "liquid.ior, liquid.absorption or fluid.N.absorption expected";
                return Err(fail(problem.into()));
            }
        }
        Ok(())
    }
}

fn vector(value: toml::Value) -> Result<Vec3, toml::de::Error> {
    // The first three of more would be taken.
    if let Some(count) = value.as_array().map(Vec::len).filter(|&count| count != 3) {
        return Err(serde::de::Error::custom(format!("3 numbers expected, found {count}")));
    }
    Ok(Vec3::from_array(value.try_into()?))
}
