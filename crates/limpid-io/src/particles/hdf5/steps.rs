//! The time steps of a file.

use std::path::Path;

use hdf5_pure::{AttrValue, File};

use super::super::npz::is_time;
use super::super::{Contents, ReadOptions, Reading};
use super::Archive;
use super::layouts::sorted;
use crate::budget::Budget;
use crate::error::Result;
use crate::files;

/// The time steps of a file.
#[derive(Default)]
pub(in crate::particles) struct Steps {
    pub(in crate::particles) count: usize,
    /// The number of each in the simulation, if the file has them.
    pub(in crate::particles) numbers: Vec<i64>,
    /// The time of each, if the file has them, s.
    pub(in crate::particles) times: Vec<f64>,
}

/// Finds the time steps; there is one in a file that cannot be read.
pub(in crate::particles) fn steps(path: &Path) -> Result<Steps> {
    let one = || Steps { count: 1, ..Steps::default() };
    let (file, metadata) = files::open(path)?;
    let (length, options) = (metadata.len(), ReadOptions::default());
    let budget = Budget::of_length(None, length);
    let mut archive = Archive::new(path, length, Reading::new(&options, &budget));
    let found = files::catch_panics(path, || archive.in_parts(file, Archive::steps));
    Ok(found.unwrap_or_else(|_| one()))
}

/// Reads one step of several.
pub(in crate::particles) fn read_step(
    path: &Path,
    step: usize,
    options: &ReadOptions,
) -> Result<Contents> {
    let (file, metadata) = files::open(path)?;
    let length = metadata.len();
    let budget = Budget::of_length(options.max_unpacked, length);
    let mut archive = Archive::new(path, length, Reading::new(options, &budget));
    archive.step = Some(step);
    files::catch_panics(path, || archive.in_parts(file, Archive::read))
}

impl Archive<'_> {
    /// Finds the time steps.
    fn steps(&mut self, file: &File) -> Result<Steps> {
        let root = file.root();
        let groups = self.groups("/", &root)?;
        let has = |name: &str| groups.iter().any(|group| group == name);
        let one = Steps { count: 1, ..Steps::default() };
        if has("VTKHDF") || has("PartType0") {
            return Ok(one);
        }
        if has("particles") {
            let particles = file.group("particles");
            let particles = particles.map_err(|error| self.damaged("particles", &error))?;
            let bodies = self.bodies(&particles)?;
            if !bodies.is_empty() {
                let (liquids, _) = sorted(bodies, self.reading.select);
                let Some(body) = liquids.first() else { return Ok(one) };
                let count = self.positions_of(&body.members).map_or(1, |(_, places)| places.steps);
                // The steps and times of H5MD are beside its values.
                let Ok(position) = file.group(&format!("{}/position", body.place)) else {
                    return Ok(Steps { count, ..one });
                };
                let beside = self.members(&body.place, &position)?;
                let mut column = |name: &str| {
                    let found = beside.iter().find(|member| member.name == name);
                    let found = found.filter(|member| member.shape == [count]);
                    found.and_then(|member| self.numbers(&body.place, member).ok())
                };
                let (numbers, times) = (column("step"), column("time"));
                let whole = |number: &f64| number.fract() == 0.0 && number.abs() < 1e15;
                let numbers = numbers.filter(|numbers| numbers.iter().all(whole));
                let numbers = numbers.unwrap_or_default().iter().map(|n| *n as i64).collect();
                return Ok(Steps { count, numbers, times: times.unwrap_or_default() });
            }
        }
        if let Some(steps) = self.numbered(&root, &groups)? {
            let time = |name: &str| {
                let attributes = file.group(name).and_then(|group| group.attrs()).ok()?;
                let time = |(name, value): (&String, &AttrValue)| {
                    let known = ["timevalue", "time"].contains(&name.to_ascii_lowercase().as_str());
                    known.then(|| value.as_f64())?
                };
                attributes.iter().find_map(time)
            };
            let times = steps.iter().map_while(|(_, name)| time(name)).collect();
            let numbers = steps.iter().map(|(number, _)| *number).collect();
            return Ok(Steps { count: steps.len(), numbers, times });
        }
        let (place, members) = self.plain(&root, &groups)?;
        let count = self.positions_of(&members).map_or(1, |(_, places)| places.steps);
        let times = match members.iter().find(|m| is_time(&m.name, &m.shape, count)) {
            Some(member) if member.grid.is_some() => self.numbers(&place, member)?,
            _ => Vec::new(),
        };
        Ok(Steps { count, numbers: Vec::new(), times })
    }
}
