//! Where attributes are read from, instead of arrays with their usual names.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::Attribute;
use super::labelled::canonical;
use crate::error::{Error, Result};

/// Where some attributes are read from, instead of arrays with their usual names; case does not matter. Its text
/// is `position=x,y,z,radius=d/2,id=none`: each attribute is read from
///
/// - an array: `velocity=U`;
/// - an array for each of its numbers: `position=x,y,z`, `velocity=u,v,w`;
/// - an array and a factor, of radii, densities and velocities: `radius=d/2`, `radius=d*0.5`; `diameter=d` is
///   the same;
/// - nothing: `id=none` leaves it out.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "BTreeMap<String, String>", into = "BTreeMap<String, String>")]
pub struct AttributeMap(BTreeMap<Attribute, Option<Source>>);

/// The arrays that an attribute is read from.
#[derive(Debug, Clone, PartialEq)]
struct Source {
    /// One, or one for each number.
    arrays: Vec<String>,
    /// Factor of its numbers.
    factor: f64,
}

impl AttributeMap {
    /// Whether it has no entries.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Leaves an attribute out; returns the text of the arrays that it would have been read from, if any.
    pub(crate) fn leave_out(&mut self, attribute: Attribute) -> Option<String> {
        self.0.insert(attribute, None).flatten().map(|source| source.to_string())
    }

    /// The attribute that a whole array of this name is read as.
    pub(super) fn attribute_of(&self, array: &str) -> Option<Attribute> {
        let is = |source: &&Option<Source>| match source {
            Some(Source { arrays, .. }) => {
                arrays.len() == 1 && arrays[0].eq_ignore_ascii_case(array)
            }
            None => false,
        };
        let mapped = self.0.iter().find(|(_, source)| is(source));
        let usual = || Attribute::from_alias(array).filter(|usual| !self.0.contains_key(usual));
        mapped.map(|(attribute, _)| *attribute).or_else(usual)
    }

    /// The array from which all of an attribute must be read, in lower case and without a unit.
    pub(super) fn array_of(&self, attribute: Attribute) -> Option<String> {
        match self.0.get(&attribute)?.as_ref()?.arrays.as_slice() {
            [name] => Some(canonical(name)),
            _ => None,
        }
    }

    /// The arrays from which the numbers of an attribute must be read, in lower case and without units.
    pub(super) fn columns_of(&self, attribute: Attribute) -> Option<Vec<String>> {
        match self.0.get(&attribute)?.as_ref()?.arrays.as_slice() {
            [_] => None,
            names => Some(names.iter().map(|name| canonical(name)).collect()),
        }
    }

    /// Whether the map says where the attribute is read from, or that it is not.
    pub(crate) fn has(&self, attribute: Attribute) -> bool {
        self.0.contains_key(&attribute)
    }

    /// Whether an array of this name is one of several from which an attribute is read.
    pub(super) fn has_column(&self, array: &str) -> bool {
        let array = canonical(array);
        let sources = self.0.values().flatten().filter(|source| source.arrays.len() > 1);
        sources.flat_map(|source| &source.arrays).any(|name| canonical(name) == array)
    }

    /// The attributes that are left out.
    pub(super) fn left_out(&self) -> impl Iterator<Item = Attribute> {
        self.0.iter().filter(|(_, source)| source.is_none()).map(|(attribute, _)| *attribute)
    }

    /// The attributes that must be read, with the text of their arrays.
    pub(super) fn wanted(&self) -> impl Iterator<Item = (Attribute, String, usize)> {
        self.0.iter().filter_map(|(attribute, source)| {
            let source = source.as_ref()?;
            Some((*attribute, source.to_string(), source.arrays.len()))
        })
    }

    /// The problem of a file without positions: neither the arrays, or columns, that the map names, nor the
    /// `usual` ones.
    pub(super) fn no_positions(
        &self,
        what: &str,
        usual: &str,
        labels: &[impl AsRef<str>],
    ) -> String {
        let first: Vec<&str> = labels.iter().take(8).map(AsRef::as_ref).collect();
        let first = first.join(", ");
        match self.0.get(&Attribute::Position) {
            Some(Some(source)) => {
                format!("position={source}: no such {what} of positions; there are: {first}")
            }
            _ => format!("no {what} {usual}; there are: {first}"),
        }
    }

    /// Returns the factor of an attribute's numbers.
    pub(super) fn factor_of(&self, attribute: Attribute) -> f64 {
        self.0.get(&attribute).and_then(Option::as_ref).map_or(1.0, |source| source.factor)
    }

    /// Adds the arrays that an attribute is read from.
    fn insert(&mut self, attribute: &str, text: &str) -> Result<(), String> {
        let halved = attribute.eq_ignore_ascii_case("diameter");
        let known = match attribute.to_ascii_lowercase().as_str() {
            "diameter" => Some(Attribute::Radius),
            "position" | "positions" => Some(Attribute::Position),
            _ => Attribute::from_alias(attribute),
        };
        let known = known.ok_or_else(|| {
            format!("no attribute `{attribute}`; there are: {}, diameter", Attribute::list())
        })?;
        let source = match text.trim() {
            "" => return Err("expected ATTRIBUTE=ARRAY, as in velocity=U,radius=d/2".into()),
            none if none.eq_ignore_ascii_case("none") && known != Attribute::Position => None,
            text => {
                let mut source = Source::parse(text, known)?;
                source.factor *= if halved { 0.5 } else { 1.0 };
                Some(source)
            }
        };
        match self.0.insert(known, source) {
            Some(_) => Err(format!("{known} is given twice")),
            None => Ok(()),
        }
    }
}

impl Source {
    fn parse(text: &str, attribute: Attribute) -> Result<Self, String> {
        let names: Vec<&str> = text.split(',').map(str::trim).collect();
        if names.contains(&"") {
            return Err("expected ATTRIBUTE=ARRAY, as in velocity=U,radius=d/2".into());
        }
        if let &[text] = names.as_slice() {
            let scales =
                matches!(attribute, Attribute::Radius | Attribute::Density | Attribute::Velocity);
            let (name, factor) = match factor(text) {
                Some((_, factor)) if !(factor > 0.0 && factor.is_finite()) => {
                    return Err(format!("`{text}`: expected a factor above 0"));
                }
                Some(_) if !scales => return Err(format!("{attribute} takes no factor")),
                found => found.unwrap_or((text, 1.0)),
            };
            return Ok(Self { arrays: vec![name.to_owned()], factor });
        }
        let takes = match attribute {
            Attribute::Velocity => [2, 3].contains(&names.len()),
            _ => attribute.width() == names.len(),
        };
        if !takes {
            let expected = match attribute.width() {
                1 => "one array".to_owned(),
                width => format!("one array, or {width}"),
            };
            return Err(format!("{attribute} takes {expected}, not {}", names.len()));
        }
        Ok(Self { arrays: names.into_iter().map(str::to_owned).collect(), factor: 1.0 })
    }
}

/// The array and the factor of `d/2`, `d*0.5` or `0.5*d`.
fn factor(text: &str) -> Option<(&str, f64)> {
    if let Some((array, divisor)) = text.rsplit_once('/')
        && let Ok(divisor) = divisor.trim().parse::<f64>()
    {
        return Some((array.trim(), 1.0 / divisor));
    }
    let (a, b) = text.rsplit_once('*')?;
    let (a, b) = (a.trim(), b.trim());
    match (a.parse(), b.parse()) {
        (_, Ok(factor)) => Some((a, factor)),
        (Ok(factor), _) => Some((b, factor)),
        _ => None,
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.arrays.join(","))?;
        if self.factor == 1.0 { Ok(()) } else { write!(f, "*{}", self.factor) }
    }
}

impl fmt::Display for AttributeMap {
    /// Writes the text that parses to the same map.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let pairs = BTreeMap::from(self.clone());
        let pairs: Vec<String> = pairs.iter().map(|(a, source)| format!("{a}={source}")).collect();
        f.write_str(&pairs.join(","))
    }
}

impl FromStr for AttributeMap {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let fail = |problem: String| Error::Usage(format!("map `{text}`: {problem}"));
        // A comma separates the arrays of an attribute as well as attributes, which have an equals sign.
        let mut pairs: Vec<(&str, String)> = Vec::new();
        for part in text.split(',') {
            match (part.split_once('='), pairs.last_mut()) {
                (Some((attribute, array)), _) => pairs.push((attribute.trim(), array.into())),
                (None, Some((_, arrays))) => *arrays += &format!(",{part}"),
                (None, None) => {
                    return Err(fail(
                        "expected ATTRIBUTE=ARRAY, as in velocity=U,radius=d/2".into(),
                    ));
                }
            }
        }
        let mut map = Self::default();
        for (attribute, arrays) in pairs {
            map.insert(attribute, &arrays).map_err(fail)?;
        }
        Ok(map)
    }
}

impl TryFrom<BTreeMap<String, String>> for AttributeMap {
    type Error = String;

    fn try_from(pairs: BTreeMap<String, String>) -> Result<Self, String> {
        let mut map = Self::default();
        for (attribute, arrays) in pairs {
            map.insert(&attribute, &arrays)?;
        }
        Ok(map)
    }
}

impl From<AttributeMap> for BTreeMap<String, String> {
    fn from(map: AttributeMap) -> Self {
        let text = |source: Option<Source>| source.map_or("none".into(), |s| s.to_string());
        map.0.into_iter().map(|(attribute, source)| (attribute.to_string(), text(source))).collect()
    }
}
