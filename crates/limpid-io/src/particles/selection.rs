//! Which particles of a file are read, by the numbers of its arrays.

use std::fmt;
use std::ops::RangeInclusive;
use std::path::Path;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::labelled::canonical;
use super::remark::Remark;
use super::{Contents, Reading};
use crate::error::{Error, Result};

/// Which particles of a file are read. Its text is `all`, or conditions on arrays of one number a particle, joined
/// by `and` or commas, all of which a particle must satisfy:
///
/// - `type==1`, and with `!=`, `<`, `<=`, `>`, `>=`;
/// - `type in 1,3`, `mk in 1..3`, with both ends, `id not in 0..99,200`.
///
/// `x`, `y` and `z` are the positions in the file, if no array has the name.
/// Case does not matter. The default leaves out walls and bodies in layouts whose meaning is known: see
/// [`Remark::LeftOut`].
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Selection {
    /// All particles but those of walls and bodies in known layouts.
    #[default]
    Automatic,
    /// All particles.
    All,
    /// Those that satisfy all of these conditions.
    Where(Vec<Condition>),
}

/// A condition on an array of one number a particle.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// The array's name.
    array: String,
    test: Test,
}

#[derive(Debug, Clone, PartialEq)]
enum Test {
    Compare(Comparison, f64),
    /// Whether the number is in one of some ranges, or in none of them.
    In(bool, Vec<RangeInclusive<f64>>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Comparison {
    Equal,
    Different,
    Less,
    AtMost,
    Greater,
    AtLeast,
}

impl Comparison {
    /// All with their signs, longer ones first.
    const SIGNS: [(&str, Self); 7] = [
        ("==", Self::Equal),
        ("!=", Self::Different),
        ("<=", Self::AtMost),
        (">=", Self::AtLeast),
        ("<", Self::Less),
        (">", Self::Greater),
        ("=", Self::Equal),
    ];
}

impl Selection {
    /// Whether it is the default.
    pub fn is_automatic(&self) -> bool {
        *self == Self::Automatic
    }

    /// Whether an array of this name may decide.
    pub(super) fn needs(&self, array: &str) -> bool {
        let array = canonical(array);
        match self {
            Self::Automatic => Layout::ALL.iter().any(|layout| layout.array == array),
            Self::All => false,
            Self::Where(conditions) => {
                conditions.iter().any(|condition| canonical(&condition.array) == array)
            }
        }
    }
}

impl Test {
    fn holds(&self, x: f64) -> bool {
        match self {
            Self::Compare(comparison, y) => match comparison {
                Comparison::Equal => x == *y,
                Comparison::Different => x != *y,
                Comparison::Less => x < *y,
                Comparison::AtMost => x <= *y,
                Comparison::Greater => x > *y,
                Comparison::AtLeast => x >= *y,
            },
            Self::In(inside, ranges) => ranges.iter().any(|range| range.contains(&x)) == *inside,
        }
    }
}

/// A layout in which the numbers of an array tell liquid from walls and bodies.
struct Layout {
    /// The array, in lower case.
    array: &'static str,
    /// Arrays of which another must be there, so that this one has the meaning; none if its name suffices.
    beside: &'static [&'static str],
    /// The numbers of walls and bodies, and those of liquid.
    solids: &'static [f64],
    liquids: &'static [f64],
}

impl Layout {
    const ALL: [Self; 2] = [
        // DualSPHysics (PartVTK): 0 fixed, 1 moving, 2 floating, 3 fluid.
        Self {
            array: "type",
            beside: &["idp", "mk", "rhop"],
            solids: &[0.0, 1.0, 2.0],
            liquids: &[3.0],
        },
        // The data sets of Graph Network Simulators (Sanchez-Gonzalez et al. 2020): 0 rigid, 3 boundary,
        // 5 water, 6 sand, 7 goop.
        Self {
            array: "particle_type",
            beside: &[],
            solids: &[0.0, 3.0],
            liquids: &[5.0, 6.0, 7.0],
        },
    ];
}

impl Contents {
    /// Which particles are selected, if not all are, with the remark that this deserves.
    ///
    /// # Errors
    /// [`Error::Format`] if the file lacks an array of a condition.
    pub(super) fn selected(
        &mut self,
        path: &Path,
        reading: &Reading<'_>,
    ) -> Result<Option<Vec<bool>>> {
        match reading.select {
            Selection::All => Ok(None),
            Selection::Automatic => Ok(self.liquid()),
            Selection::Where(_) if self.particles.is_empty() => Ok(None),
            Selection::Where(conditions) => {
                let mut selected = vec![true; self.particles.len()];
                for condition in conditions {
                    let name = canonical(&condition.array);
                    let column = self.columns.iter().find(|(kept, _)| *kept == name);
                    let axis = ["x", "y", "z"].iter().position(|axis| *axis == name);
                    if let (None, Some(axis)) = (column, axis) {
                        for (i, selected) in selected.iter_mut().enumerate() {
                            *selected &= condition.test.holds(self.particles.place(i)[axis]);
                        }
                        continue;
                    }
                    let Some((_, numbers)) = column else {
                        let problem = format!(
                            "select {}: no array `{}` of one number a particle; there are: {}",
                            reading.select,
                            condition.array,
                            self.listed_arrays()
                        );
                        return Err(Error::format(path, problem));
                    };
                    for (selected, &number) in selected.iter_mut().zip(numbers) {
                        *selected &= condition.test.holds(number);
                    }
                }
                if !selected.contains(&true) {
                    let selection = reading.select.to_string();
                    self.remarks.push(Remark::NoneSelected { selection });
                }
                Ok(Some(selected))
            }
        }
    }

    /// Which particles are liquid, if an array of a known layout tells that some are not.
    fn liquid(&mut self) -> Option<Vec<bool>> {
        let has = |name: &&str| self.arrays.iter().any(|array| canonical(&array.name) == **name);
        let (layout, numbers) = Layout::ALL.iter().find_map(|layout| {
            let known = layout.beside.is_empty() || layout.beside.iter().any(has);
            let (_, numbers) = self.columns.iter().find(|(name, _)| name == layout.array)?;
            known.then_some((layout, numbers))
        })?;
        let is_solid = |number: &f64| layout.solids.contains(number);
        let count = numbers.iter().filter(|number| is_solid(number)).count();
        // A file of walls alone is shown.
        if count == 0 || !numbers.iter().any(|number| layout.liquids.contains(number)) {
            return None;
        }
        let liquid = numbers.iter().map(|number| !is_solid(number)).collect();
        let found = layout.solids.iter().filter(|solid| numbers.contains(solid));
        let found: Vec<String> = found.map(f64::to_string).collect();
        let name = self.arrays.iter().find(|array| canonical(&array.name) == layout.array);
        let name = name.map_or(layout.array, |array| &array.name);
        let why = format!("{name} {}", found.join(" and "));
        self.remarks.push(Remark::LeftOut { count, why });
        Some(liquid)
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.test {
            Test::Compare(comparison, number) => {
                let sign = Comparison::SIGNS.iter().find(|(_, known)| known == comparison);
                write!(f, "{}{}{number}", self.array, sign.map_or("==", |(sign, _)| sign))
            }
            Test::In(inside, ranges) => {
                let range = |range: &RangeInclusive<f64>| match range.start() == range.end() {
                    true => range.start().to_string(),
                    false => format!("{}..{}", range.start(), range.end()),
                };
                let ranges: Vec<String> = ranges.iter().map(range).collect();
                let not = if *inside { "" } else { "not " };
                write!(f, "{} {not}in {}", self.array, ranges.join(","))
            }
        }
    }
}

impl fmt::Display for Selection {
    /// Writes the text that parses to the same selection; nothing for the default.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Automatic => Ok(()),
            Self::All => f.write_str("all"),
            Self::Where(conditions) => {
                let conditions: Vec<String> = conditions.iter().map(Condition::to_string).collect();
                f.write_str(&conditions.join(" and "))
            }
        }
    }
}

/// A number of a condition.
fn number(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|number: &f64| number.is_finite())
}

/// A number, or a range such as `1..3` or `1..=3`.
fn range(text: &str) -> Option<RangeInclusive<f64>> {
    let text = text.trim_matches(|c: char| c.is_whitespace() || "()[]{}".contains(c));
    match text.split_once("..") {
        None => number(text).map(|number| number..=number),
        Some((first, last)) => {
            let last = number(last.trim().trim_start_matches('='))?;
            number(first).map(|first| first..=last).filter(|range| !range.is_empty())
        }
    }
}

/// The text before and after a word, which blanks separate, in any case.
fn around_word<'a>(text: &'a str, word: &str) -> Option<(&'a str, &'a str)> {
    let lower = text.to_ascii_lowercase();
    let is_blank = |c: Option<char>| c.is_none_or(char::is_whitespace);
    lower.match_indices(word).find_map(|(at, _)| {
        let (before, after) = (&text[..at], &text[at + word.len()..]);
        (is_blank(before.chars().next_back()) && is_blank(after.chars().next()))
            .then_some((before, after))
    })
}

fn condition(text: &str) -> Result<Condition, String> {
    let name = |text: &str| text.trim().trim_matches(['"', '\'']).to_owned();
    let expected = || format!("`{}`: expected ARRAY==NUMBER or ARRAY in 1,3 or 1..3", text.trim());
    let condition = match around_word(text, "in") {
        Some((array, items)) => {
            let not = around_word(array, "not").filter(|(_, after)| after.trim().is_empty());
            let array = not.map_or(array, |(before, _)| before);
            let range = range(items).ok_or_else(expected)?;
            Condition { array: name(array), test: Test::In(not.is_none(), vec![range]) }
        }
        None => {
            let found = Comparison::SIGNS
                .iter()
                .filter_map(|&(sign, comparison)| text.find(sign).map(|at| (at, sign, comparison)));
            // The first, and of those at the same place the longest.
            let first = found.min_by_key(|&(at, sign, _)| (at, std::cmp::Reverse(sign.len())));
            let (at, sign, comparison) = first.ok_or_else(expected)?;
            let value = text[at + sign.len()..].trim().trim_matches(['"', '\'']);
            let value = number(value).ok_or_else(expected)?;
            Condition { array: name(&text[..at]), test: Test::Compare(comparison, value) }
        }
    };
    if condition.array.is_empty() { Err(expected()) } else { Ok(condition) }
}

impl FromStr for Selection {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let fail = |problem: String| Error::Usage(format!("select `{text}`: {problem}"));
        // Some shells leave the quotes.
        let mut rest = text.trim().trim_matches(['"', '\'']);
        if rest.eq_ignore_ascii_case("all") {
            return Ok(Self::All);
        }
        let mut conditions: Vec<Condition> = Vec::new();
        loop {
            let (part, after) = match around_word(rest, "and") {
                Some((part, after)) => (part, Some(after)),
                None => (rest, None),
            };
            for item in part.split(',') {
                // A number after a list belongs to it.
                match (range(item), conditions.last_mut()) {
                    (Some(range), Some(Condition { test: Test::In(_, ranges), .. })) => {
                        ranges.push(range);
                    }
                    _ => conditions.push(condition(item).map_err(fail)?),
                }
            }
            match after {
                Some(after) => rest = after,
                None => return Ok(Self::Where(conditions)),
            }
        }
    }
}

impl TryFrom<String> for Selection {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse().map_err(|error: Error| error.to_string())
    }
}

impl From<Selection> for String {
    fn from(selection: Selection) -> Self {
        selection.to_string()
    }
}
