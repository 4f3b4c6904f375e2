//! HDF5 (The HDF Group, "HDF5 File Format Specification", version 3.0), in the layouts of simulators:
//!
//! | layout | particles |
//! |---|---|
//! | SWIFT, Gadget | `PartType0`, which is gas and liquid: `Coordinates`, `Velocities`, `Densities`, `ParticleIDs` |
//! | `PySPH` | `particles/NAME/arrays`: `x`, `y`, `z`, `u`, `v`, `w`, `rho`, of each NAME that is liquid |
//! | VTKHDF | `VTKHDF/Points` and `VTKHDF/PointData`, of an unstructured grid or polygonal data |
//! | other | positions as in `.npz`, or columns `x`, `y`, `z`, at the root or in a single group |
//!
//! Numbers are taken as they are. The units that SWIFT and Gadget note beside them would make metres of
//! megaparsecs, which nobody wants to see: a scale does it where it is wanted. Smoothing lengths are no radii
//! and are ignored, as is the size of a periodic box.
//!
//! The crate `hdf5-pure` decodes. What a file claims is held against its length before it is asked for.

mod adapt;

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};

use hdf5_pure::{
    AttrValue, Dataset, Datatype, DatatypeByteOrder, File, FixedPointLayout, FloatingPointLayout,
    FormatError, Group, ReadSeekSource,
};

use self::adapt::Link;
use super::axes::{Axes, Grid, Places};
use super::labelled::{position_among, velocity_among};
use super::npz::{POSITIONS, is_time, positions_among};
use super::vtk::is_point;
use super::{
    Attribute, Column, Contents, FileBytes, ReadOptions, Reading, Remark, Scalar, Selection, Table,
    Unit, attribute_names, foreign, pieces,
};
use crate::budget::Budget;
use crate::error::{Error, Location, Result, printable};
use crate::files::{self, DEFLATE_RATIO};
use limpid::memory;

pub(super) fn read(path: &Path, bytes: &[u8], reading: &Reading<'_>) -> Result<Contents> {
    if !hdf5_pure::is_hdf5_bytes(bytes) {
        return Err(foreign(path, bytes, "an HDF5 file"));
    }
    // The decoder keeps a copy of the file.
    let mut copy = memory::reserve(bytes.len(), path.display())?;
    copy.extend_from_slice(bytes);
    let mut archive = Archive::new(path, bytes.len() as u64, *reading);
    // It is young (0.47), and some of its sums are unchecked: with overflow checks a damaged file could end
    // the program.
    files::catch_panics(path, || {
        let file = archive.adapted(copy)?;
        archive.read(&file)
    })
}

/// The time steps of a file.
#[derive(Default)]
pub(super) struct Steps {
    pub(super) count: usize,
    /// The number of each in the simulation, if the file has them.
    pub(super) numbers: Vec<i64>,
    /// The time of each, if the file has them, s.
    pub(super) times: Vec<f64>,
}

/// Finds the time steps; there is one in a file that cannot be read.
pub(super) fn steps(path: &Path) -> Result<Steps> {
    let one = || Steps { count: 1, ..Steps::default() };
    let (file, metadata) = files::open(path)?;
    let (length, options) = (metadata.len(), ReadOptions::default());
    let budget = Budget::of_length(None, length);
    let mut archive = Archive::new(path, length, Reading::new(&options, &budget));
    let found = files::catch_panics(path, || archive.in_parts(file, Archive::steps));
    Ok(found.unwrap_or_else(|_| one()))
}

/// Reads one step of several.
pub(super) fn read_step(path: &Path, step: usize, options: &ReadOptions) -> Result<Contents> {
    let (file, metadata) = files::open(path)?;
    let length = metadata.len();
    let budget = Budget::of_length(options.max_unpacked, length);
    let mut archive = Archive::new(path, length, Reading::new(options, &budget));
    archive.step = Some(step);
    files::catch_panics(path, || archive.in_parts(file, Archive::read))
}

/// A file.
struct Archive<'a> {
    path: &'a Path,
    /// Size of the file, bytes.
    packed: u64,
    /// For the unpacked arrays and the attributes read from them.
    budget: &'a Budget,
    reading: Reading<'a>,
    /// The step to read of several.
    step: Option<usize>,
    /// Links that the decoder passes over.
    links: Vec<Link>,
}

/// An array of a group.
struct Member {
    name: String,
    dataset: Dataset,
    /// Its size along each axis.
    shape: Vec<usize>,
    /// The same with the type of its numbers; `None` for other data.
    grid: Option<Grid>,
}

impl Member {
    /// Whether it has one number per particle.
    fn is_column(&self) -> bool {
        self.grid.is_some() && matches!(self.shape.as_slice(), [_] | [_, 1])
    }

    /// Size of its first axis.
    fn rows(&self) -> usize {
        self.shape.first().copied().unwrap_or(0)
    }

    /// Whether it has one number per particle, at each step if the positions are columns with steps.
    fn is_column_beside(&self, places: &Places) -> bool {
        let stepped = places.axes.numbers.is_none() && self.shape == [places.steps, places.rows];
        self.is_column() || self.grid.is_some() && stepped
    }
}

/// Liquid or solid particles under `particles`.
struct Body {
    name: String,
    place: String,
    members: Vec<Member>,
}

impl<'a> Archive<'a> {
    fn new(path: &'a Path, packed: u64, reading: Reading<'a>) -> Self {
        let budget = reading.budget;
        Self { path, packed, budget, reading, step: None, links: Vec::new() }
    }

    /// Opens a file in memory, which is changed so that the decoder knows it.
    fn adapted(&mut self, mut bytes: Vec<u8>) -> Result<File> {
        self.links = adapt::adapt(&mut bytes);
        File::from_bytes(bytes).map_err(|error| self.damaged("/", &error))
    }

    /// Reads from a file only what is needed, or all of it if the decoder knows it only when it is adapted.
    fn in_parts<T>(
        &mut self,
        file: files::File,
        read: impl Fn(&mut Self, &File) -> Result<T>,
    ) -> Result<T> {
        let used = self.budget.used();
        let source = ReadSeekSource::new(file).map_err(hdf5_pure::Error::Format);
        let opened = source.and_then(File::from_source);
        let opened = opened.map_err(|error| self.damaged("/", &error));
        if let Ok(found) = opened.and_then(|file| read(self, &file)) {
            return Ok(found);
        }
        self.budget.rewind(used);
        let mut bytes = Vec::new();
        files::read(self.path, |_| self.budget.limit(), &mut bytes)?;
        let file = self.adapted(bytes)?;
        read(self, &file)
    }

    fn read(&mut self, file: &File) -> Result<Contents> {
        let root = file.root();
        let groups = self.groups("/", &root)?;
        let has = |name: &str| groups.iter().any(|group| group == name);
        let group = |name: &str| file.group(name).map_err(|error| self.damaged(name, &error));
        if has("VTKHDF") {
            let group = group("VTKHDF")?;
            return self.vtkhdf(&group);
        }
        if has("PartType0") {
            let members = self.members("PartType0", &group("PartType0")?)?;
            let header = has("Header").then(|| group("Header")).transpose()?;
            let found = self.rows_of(&members);
            let remark = header.map(|header| self.snapshot(&header, found)).transpose()?.flatten();
            let mut contents = self.take("PartType0", &members)?;
            contents.remarks.extend(remark);
            return Ok(contents);
        }
        if has("particles") {
            let bodies = self.bodies(&group("particles")?)?;
            if !bodies.is_empty() {
                return self.liquids(bodies);
            }
        }
        if let Some(steps) = self.numbered(&root, &groups)? {
            let step = match (self.step, steps.as_slice()) {
                (Some(step), _) => steps.get(step),
                (None, [one]) => Some(one),
                (None, _) => return Err(super::several(self.path)),
            };
            let Some((_, name)) = step else { return Err(self.no_step(steps.len())) };
            let members = self.members(name, &group(name)?)?;
            // Its arrays have no steps of their own.
            let step = self.step.take();
            let contents = self.take(name, &members);
            self.step = step;
            return contents;
        }
        let (place, members) = self.plain(&root, &groups)?;
        self.take(&place, &members)
    }

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

    /// The groups of a group.
    fn groups(&self, place: &str, group: &Group) -> Result<Vec<String>> {
        group.groups().map_err(|error| self.damaged(place, &error))
    }

    /// The groups of time steps with their numbers, as `Step#0` of H5Part, in order; `None` if there are none.
    fn numbered(&self, root: &Group, groups: &[String]) -> Result<Option<Vec<(i64, String)>>> {
        /// What a step is called, before its number.
        const WORDS: [&str; 10] = [
            "",
            "step",
            "timestep",
            "time_step",
            "time",
            "t",
            "frame",
            "iteration",
            "iter",
            "snapshot",
        ];
        let number = |name: &String| {
            let word = name.trim_end_matches(|c: char| c.is_ascii_digit());
            let number = name[word.len()..].parse::<i64>().ok()?;
            let word = word.trim_end_matches(|c: char| !c.is_alphanumeric()).to_ascii_lowercase();
            WORDS.contains(&word.as_str()).then(|| (number, name.clone()))
        };
        let mut steps: Vec<_> = groups.iter().filter_map(number).collect();
        steps.sort();
        let Some((_, first)) = steps.first() else { return Ok(None) };
        let group = root.group(first).map_err(|error| self.damaged(first, &error))?;
        let members = self.members(first, &group)?;
        // Arrays with steps of their own are several runs.
        let one = self.positions_of(&members).is_some_and(|(_, places)| places.steps == 1);
        let distinct = steps.array_windows().all(|[(a, _), (b, _)]| a < b);
        Ok(Some(steps).filter(|_| one && distinct))
    }

    fn no_step(&self, steps: usize) -> Error {
        let step = self.step.unwrap_or(0);
        let problem = format!("step {step}: the file has {steps} now");
        Error::malformed(self.path, Location::Byte(0), problem)
    }

    /// Compares the header of a snapshot with the number of particles that were read; returns a remark if other files
    /// have the rest of them.
    fn snapshot(&self, header: &Group, found: usize) -> Result<Option<Remark>> {
        let attributes = header.attrs().map_err(|error| self.damaged("Header", &error))?;
        // The first kind is the one that is read.
        let first = |name: &str| -> Option<i64> {
            attributes.get(name).and_then(AttrValue::to_i64s)?.first().copied()
        };
        let fail = |problem: String| Error::malformed(self.path, Location::Byte(0), problem);
        if let Some(said) = first("NumPart_ThisFile").filter(|&said| said != found as i64) {
            let problem = format!("NumPart_ThisFile is {said}, but there are {found} particles");
            return Err(fail(problem));
        }
        let files = first("NumFilesPerSnapshot").unwrap_or(1);
        let high = first("NumPart_Total_HighWord").unwrap_or(0);
        let total = first("NumPart_Total");
        let total = total.map(|low| low.saturating_add(high.saturating_mul(1 << 32)));
        let found = found as u64;
        Ok(match total.map(u64::try_from) {
            Some(Err(_)) => return Err(fail("NumPart_Total is less than 0".into())),
            Some(Ok(total)) if total < found => {
                let problem = format!("NumPart_Total is {total}, but there are {found} particles");
                return Err(fail(problem));
            }
            Some(Ok(total)) => {
                (total > found).then_some(Remark::Partial { found, total, unit: Unit::Particles })
            }
            None => u64::try_from(files)
                .ok()
                .filter(|&files| files > 1)
                .map(|total| Remark::Partial { found: 1, total, unit: Unit::Files }),
        })
    }

    /// Reads VTKHDF (Kitware, "VTKHDF file format", version 2).
    fn vtkhdf(&mut self, group: &Group) -> Result<Contents> {
        let place = "VTKHDF";
        let attributes = group.attrs().map_err(|error| self.damaged(place, &error))?;
        let kind = attributes.get("Type").and_then(|kind| kind.as_str()).unwrap_or_default();
        if !matches!(kind, "UnstructuredGrid" | "PolyData") {
            let problem = format!(
                "VTKHDF of the type `{}`: expected UnstructuredGrid or PolyData",
                printable(kind.into())
            );
            return Err(Error::format(self.path, problem));
        }
        let groups = group.groups().map_err(|error| self.damaged(place, &error))?;
        let child = |name: &str| -> Result<Option<Group>> {
            let there = groups.iter().any(|group| group == name);
            let open = || group.group(name).map_err(|error| self.damaged(place, &error));
            there.then(open).transpose()
        };
        if let Some(steps) = child("Steps")? {
            let attributes = steps.attrs().map_err(|error| self.damaged(place, &error))?;
            let steps = attributes.get("NSteps").and_then(AttrValue::as_i64);
            if let Some(steps) = steps.filter(|&steps| steps > 1) {
                let problem = format!(
                    "{steps} time steps in one file; save each step as a file of its own (in ParaView: \
                     Save Data, Write Time Steps)"
                );
                return Err(Error::format(self.path, problem));
            }
        }
        let (data, cell_data, vertices) =
            (child("PointData")?, child("CellData")?, child("Vertices")?);
        let faces = ["Lines", "Strips", "Polygons"].map(child);
        let mut members = self.members(place, group)?;
        let mut cells = 0_usize;
        for faces in faces {
            let Some(faces) = faces? else { continue };
            for member in self.members(place, &faces)? {
                if member.name == "NumberOfCells" && member.is_column() {
                    let counts = self.numbers(place, &member)?;
                    cells = counts.iter().fold(cells, |sum, &n| sum.saturating_add(n as usize));
                }
            }
        }
        let mut connectivity = None;
        if let Some(types) = members.iter().find(|m| m.name == "Types" && m.is_column()) {
            let types = self.numbers(place, types)?;
            cells += types.iter().filter(|&&kind| !is_point(Some(kind as i64))).count();
            connectivity = members.iter().find(|m| m.name == "Connectivity" && m.is_column());
        }
        let vertices = match vertices {
            Some(vertices) => self.members("VTKHDF/Vertices", &vertices)?,
            None => Vec::new(),
        };
        connectivity = connectivity
            .or_else(|| vertices.iter().find(|m| m.name == "Connectivity" && m.is_column()));
        // Data of cells are those of points where each point has a cell of its own, in the same order.
        let mut own_cells = false;
        if let Some(connectivity) = connectivity.filter(|_| cells == 0) {
            let points = self.numbers(place, connectivity)?;
            own_cells = points.iter().enumerate().all(|(k, &point)| point == k as f64);
        }
        // One number for each part.
        let counts = members.iter().find(|m| m.name == "NumberOfPoints" && m.is_column());
        let counts = counts.map(|counts| self.numbers(place, counts)).transpose()?;
        let said = counts.map(|counts| counts.iter().fold(0.0, |sum, n| sum + n));
        members.retain(|member| member.name == "Points");
        if let Some(data) = data {
            members.extend(self.members("VTKHDF/PointData", &data)?);
        }
        let rows = members.first().map_or(0, Member::rows);
        if let Some(said) = said.filter(|&said| said != rows as f64) {
            let problem = format!("NumberOfPoints is {said}, but there are {rows} points");
            return Err(Error::malformed(self.path, Location::Byte(0), problem));
        }
        let mut ignored = Vec::new();
        if let Some(data) = cell_data {
            for member in self.members("VTKHDF/CellData", &data)? {
                let known = members.iter().any(|other| other.name == member.name);
                match own_cells && !known && member.rows() == rows {
                    true => members.push(member),
                    false => ignored.push(member),
                }
            }
        }
        let mut contents = self.take(place, &members)?;
        for member in ignored {
            contents.list(&member.name, &member.shape, None);
        }
        Ok(Contents { cells, ..contents })
    }

    /// The bodies under `particles`, as `PySPH` and H5MD have them; none in other layouts.
    fn bodies(&self, group: &Group) -> Result<Vec<Body>> {
        let mut bodies = Vec::new();
        for name in self.groups("particles", group)? {
            let place = format!("particles/{name}");
            let body = group.group(&name).map_err(|error| self.damaged(&place, &error))?;
            if let Ok(arrays) = body.group("arrays") {
                let place = format!("{place}/arrays");
                let members = self.members(&place, &arrays)?;
                bodies.push(Body { name, place, members });
                continue;
            }
            // In H5MD (de Buyl, Colberg and Höfling, "H5MD: a structured, efficient, and portable file
            // format", 2014) what changes with time is a group, with its `value`.
            let mut members = self.members(&place, &body)?;
            for element in self.groups(&place, &body)? {
                let values = body.group(&element).and_then(|group| group.dataset("value"));
                members.extend(values.ok().and_then(|dataset| member(element, dataset)));
            }
            if members.iter().any(|member| member.name == "position") {
                bodies.push(Body { name, place, members });
            }
        }
        Ok(bodies)
    }

    /// Reads the bodies that are liquid; solids are listed as ignored arrays.
    fn liquids(&mut self, bodies: Vec<Body>) -> Result<Contents> {
        let (liquids, solids) = sorted(bodies, self.reading.select);
        if liquids.is_empty() {
            let names: Vec<_> =
                solids.iter().take(8).map(|body| printable(body.name.clone())).collect();
            let problem = format!("only solids ({}), no liquid", names.join(", "));
            return Err(Error::format(self.path, problem));
        }
        let mut parts = Vec::new();
        for body in &liquids {
            let mut part = self.take(&body.place, &body.members)?;
            part.settle(self.path, &self.reading)?;
            parts.push((body.name.clone(), part));
        }
        let mut contents = pieces::joined(self.path, parts)?;
        let mut walls = 0;
        for body in &solids {
            let count = self.positions_of(&body.members).map_or(0, |(_, places)| places.rows);
            contents.list(&body.name, &[count, 3], None);
            walls += count;
        }
        if walls > 0 {
            let names: Vec<_> = solids.iter().map(|body| printable(body.name.clone())).collect();
            contents.remarks.push(Remark::LeftOut { count: walls, why: names.join(", ") });
        }
        Ok(contents)
    }

    /// Finds arrays without a known layout: of the root, or of the only group that has positions, or the only one whose
    /// name is none of a solid. Returns the place and the arrays.
    fn plain(&self, root: &Group, groups: &[String]) -> Result<(String, Vec<Member>)> {
        /// Largest number of groups to look into.
        const MOST: usize = 64;
        /// Groups within groups.
        const DEPTH: usize = 3;
        let members = self.members("/", root)?;
        if self.positions_of(&members).is_some() {
            return Ok(("/".into(), members));
        }
        let mut found = Vec::new();
        let (mut places, mut next) = (groups.to_vec(), 0);
        while let Some(place) = places.get(next).filter(|_| next < MOST).cloned() {
            next += 1;
            let group = root.group(&place).map_err(|error| self.damaged(&place, &error))?;
            let members = self.members(&place, &group)?;
            if self.positions_of(&members).is_some() {
                found.push((place, members));
            } else if place.matches('/').count() < DEPTH {
                let inner = self.groups(&place, &group)?;
                places.extend(inner.into_iter().map(|name| format!("{place}/{name}")));
            }
        }
        let name = |at: &usize| found[*at].0.rsplit('/').next().unwrap_or_default();
        let mut liquids: Vec<usize> = (0..found.len()).filter(|at| !is_solid(name(at))).collect();
        if liquids.iter().any(|at| is_liquid(name(at))) {
            liquids.retain(|at| is_liquid(name(at)));
        }
        if let &[one] = liquids.as_slice() {
            return Ok(found.swap_remove(one));
        }
        let problem = if found.is_empty() {
            let external = || self.external_positions("/");
            if let Some(problem) = unusual_positions(&members).or_else(external) {
                return Err(Error::format(self.path, problem));
            }
            if self.reading.map.has(Attribute::Position) {
                let names: Vec<&str> = members.iter().map(|member| member.name.as_str()).collect();
                return Err(Error::format(
                    self.path,
                    self.reading.map.no_positions("array", "", &names),
                ));
            }
            let names = members.iter().map(|member| &member.name).chain(groups);
            let names: Vec<_> = names.take(8).map(|name| printable(name.clone())).collect();
            format!(
                "no PartType0, particles/NAME/arrays, VTKHDF, or array of positions of shape (n, 3); there \
                 are: {}",
                names.join(", ")
            )
        } else {
            let names: Vec<_> = found.iter().map(|(name, _)| printable(name.clone())).collect();
            format!("positions in several groups: {}; keep one of them", names.join(", "))
        };
        Err(Error::format(self.path, problem))
    }

    /// Lists the arrays of a group, and those that its links name.
    fn members(&self, place: &str, group: &Group) -> Result<Vec<Member>> {
        let datasets = group.iter_datasets().map_err(|error| self.damaged(place, &error))?;
        let datasets = datasets.filter_map(|(name, dataset)| member(name, dataset));
        let linked = self.links_of(place).filter(|link| link.file.is_none()).filter_map(|link| {
            let dataset = group.dataset(&format!("/{}", adapt::path_of(link))).ok()?;
            member(link.name.clone(), dataset)
        });
        Ok(datasets.chain(linked).collect())
    }

    /// The links of a group that the decoder passes over.
    fn links_of(&self, place: &str) -> impl Iterator<Item = &Link> {
        self.links.iter().filter(move |link| link.group == place.trim_matches('/'))
    }

    /// The problem of positions that are in another file.
    fn external_positions(&self, place: &str) -> Option<String> {
        let mut links = self.links_of(place).filter(|link| {
            POSITIONS.iter().any(|known| link.name.eq_ignore_ascii_case(known))
                || link.group.is_empty() && link.name == "PartType0"
        });
        let (name, file) = links.find_map(|link| Some((&link.name, link.file.as_ref()?)))?;
        let (name, file) = (printable(name.clone()), printable(file.clone()));
        Some(format!("{name} is a link to the file {file}, which is not followed; name that file"))
    }

    /// The array of the positions, or the columns of their coordinates, and how they lie.
    fn positions_of(&self, members: &[Member]) -> Option<(Vec<usize>, Places)> {
        let arrays: Vec<_> =
            members.iter().map(|member| (member.name.as_str(), member.grid.as_ref())).collect();
        let map = self.reading.map;
        if let Some((at, places)) = positions_among(&arrays, map) {
            return Some((vec![at], places));
        }
        let among = |labels: &[&str]| position_among(labels, map);
        let stepped = |member: &Member| member.grid.is_some() && member.shape.len() == 2;
        let columns = columns_among(members, Member::is_column, among)
            .or_else(|| columns_among(members, stepped, among))?;
        let shape = members[*columns.first()?].shape.as_slice();
        let alike = columns.iter().all(|&at| members[at].shape == shape);
        Some((columns, Places::of_columns(shape))).filter(|_| alike || shape.len() == 1)
    }

    /// Number of the positions in a group.
    fn rows_of(&self, members: &[Member]) -> usize {
        self.positions_of(members).map_or(0, |(_, places)| places.rows)
    }

    /// The columns of the velocities, if they are no array of their own.
    fn velocities_of(&self, members: &[Member], places: &Places) -> Option<Vec<usize>> {
        let map = self.reading.map;
        let is_whole = |member: &Member| {
            let grid = member.grid.as_ref();
            map.attribute_of(&member.name) == Some(Attribute::Velocity)
                && grid.is_some_and(|grid| grid.attribute(Attribute::Velocity, places).is_some())
        };
        match members.iter().any(is_whole) {
            true => None,
            false => {
                let beside = |member: &Member| member.is_column_beside(places);
                columns_among(members, beside, |labels| velocity_among(labels, map))
            }
        }
    }

    /// Reads positions and attributes from the arrays of a group.
    fn take(&mut self, place: &str, members: &[Member]) -> Result<Contents> {
        let Some((positions, places)) = self.positions_of(members) else {
            let names: Vec<_> = members.iter().take(8).map(|m| printable(m.name.clone())).collect();
            let known = unusual_positions(members).or_else(|| self.external_positions(place));
            let problem = known.unwrap_or_else(|| {
                format!("no positions of shape (n, 3); there are: {}", names.join(", "))
            });
            return Err(Error::format(self.path, format!("{place}: {problem}")));
        };
        let step = match self.step {
            None if places.steps == 0 => return Ok(Contents::default()),
            None if places.steps > 1 => return Err(super::several(self.path)),
            Some(step) if step >= places.steps => return Err(self.no_step(places.steps)),
            step => step.unwrap_or(0),
        };
        let first = &members[positions[0]];
        let path = self.display_path(place, &first.name);
        let (table, columns) = match positions.as_slice() {
            [_] => self.table(&path, place, first, places.axes, step)?,
            _ => self.columns(&path, place, members, &positions, &places, step)?,
        };
        // The positions take no more memory than their arrays.
        self.count(&path, table.bytes.len() as u64)?;
        let Some(xyz) = places.coordinates(&columns) else { return Ok(Contents::default()) };
        let mut contents = table.particles(xyz)?;
        if let ([_], Some(grid)) = (positions.as_slice(), &first.grid) {
            contents.remarks = places.remarks(&printable(first.name.clone()), grid);
        }
        drop(table);
        if self.reading.map.has(Attribute::Position) {
            let names: Vec<_> = positions.iter().map(|&at| members[at].name.as_str()).collect();
            let shape = [contents.particles.len(), 3];
            contents.list(&names.join(" "), &shape, Some(Attribute::Position));
        }
        let velocity = self.velocities_of(members, &places);
        if let Some(fields) = &velocity {
            let names: Vec<_> = fields.iter().map(|&at| members[at].name.as_str()).collect();
            let name = names.join(" ");
            let path = self.display_path(place, &name);
            let (table, columns) = self.columns(&path, place, members, fields, &places, step)?;
            let shape = [table.rows, columns.len()];
            self.count(&path, Attribute::Velocity.bytes().saturating_mul(table.rows as u64))?;
            contents.take_as(Some(Attribute::Velocity), &name, &shape, &table, &columns)?;
        }
        for link in self.links_of(place) {
            if let (Some(file), Some(attribute)) =
                (&link.file, self.reading.map.attribute_of(&link.name))
            {
                contents.remarks.push(Remark::Unusable {
                    array: printable(link.name.clone()),
                    problem: format!("{attribute} is in the file {}", printable(file.clone())),
                });
            }
        }
        let used =
            |at: usize| positions.contains(&at) || velocity.iter().flatten().any(|&f| f == at);
        for (_, member) in members.iter().enumerate().filter(|&(at, _)| !used(at)) {
            let has = |attribute: &Attribute| {
                attribute_names(&contents.particles).any(|has| has == attribute.name())
            };
            let attribute =
                self.reading.map.attribute_of(&member.name).filter(|attribute| !has(attribute));
            let (name, shape) = (&member.name, &member.shape);
            let grid = member.grid.as_ref();
            let keeps = self.reading.keeps(name);
            let is_label = self.reading.values && grid.is_some_and(|grid| !grid.is_float());
            let axes = match attribute {
                Some(attribute) => grid.and_then(|grid| grid.attribute(attribute, &places)),
                None if keeps || is_label => grid.and_then(|grid| grid.axes_of(1, &places)),
                None => None,
            };
            let Some(axes) = axes else {
                if let (Some(attribute), None) = (attribute, grid) {
                    contents.remarks.push(Remark::Unusable {
                        array: printable(name.clone()),
                        problem: format!("{attribute} in numbers of an unusual type"),
                    });
                }
                if !is_time(name, shape, places.steps) {
                    contents.pass_over(attribute.filter(|_| grid.is_some()), name, shape);
                }
                continue;
            };
            let path = self.display_path(place, name);
            let (table, columns) = match self.table(&path, place, member, axes, step) {
                Ok((table, _)) if attribute.is_none() && table.rows != contents.particles.len() => {
                    contents.list(name, shape, None);
                    continue;
                }
                // Only its values would have been listed.
                Err(_) if attribute.is_none() && !keeps => {
                    contents.list(name, shape, None);
                    continue;
                }
                read => read?,
            };
            let vector = attribute.is_some_and(|attribute| attribute.width() == 3);
            let columns = if vector { places.vector(columns) } else { columns };
            self.count(&path, self.reading.bytes_of(name).saturating_mul(table.rows as u64))?;
            contents.keep(&self.reading, name, &table, &columns)?;
            contents.take_as(attribute, name, shape, &table, &columns)?;
            contents.find_values(&self.reading, name, &table, &columns);
        }
        Ok(contents)
    }

    /// The table of a step of an array, and its columns.
    fn table<'p>(
        &mut self,
        path: &'p Path,
        place: &str,
        member: &Member,
        axes: Axes,
        step: usize,
    ) -> Result<(Table<'p>, Vec<Column>)> {
        let (bytes, grid) = self.load(place, member, axes, step)?;
        let source = FileBytes { path, bytes: &[], text: false };
        let table = grid.table(axes, step, source, 0, Cow::Owned(bytes));
        table.ok_or_else(|| source.error(0, "an array beyond all memory"))
    }

    /// The table of several columns side by side, and its columns.
    fn columns<'p>(
        &mut self,
        path: &'p Path,
        place: &str,
        members: &[Member],
        fields: &[usize],
        places: &Places,
        step: usize,
    ) -> Result<(Table<'p>, Vec<Column>)> {
        let stepped = |member: &Member| places.axes.numbers.is_none() && !member.is_column();
        let mut columns = Vec::new();
        for member in fields.iter().map(|&at| &members[at]) {
            let numbers = match stepped(member) {
                true => self.numbers_of(place, member, places.axes, step)?,
                false => self.numbers(place, member)?,
            };
            self.count(path, size_of_val(&numbers[..]) as u64)?;
            columns.push(numbers);
        }
        Table::of_columns(path, &columns)
    }

    /// The numbers of a column.
    fn numbers(&mut self, place: &str, member: &Member) -> Result<Vec<f64>> {
        self.numbers_of(place, member, Axes { steps: None, particles: 0, numbers: None }, 0)
    }

    /// The numbers of an array at a step.
    fn numbers_of(
        &mut self,
        place: &str,
        member: &Member,
        axes: Axes,
        step: usize,
    ) -> Result<Vec<f64>> {
        let (bytes, grid) = self.load(place, member, axes, step)?;
        let (scalar, big_endian) = (grid.scalar, grid.big_endian);
        let numbers = bytes.chunks_exact(scalar.size()).map(|x| scalar.number(x, big_endian));
        Ok(memory::collect(numbers, self.path.display())?)
    }

    /// Unpacks the part of an array that a step needs to numbers in the file's byte order.
    fn load<'m>(
        &mut self,
        place: &str,
        member: &'m Member,
        axes: Axes,
        step: usize,
    ) -> Result<(Vec<u8>, &'m Grid)> {
        let path = self.display_path(place, &member.name);
        let fail = |problem: String| Error::malformed(&path, Location::Byte(0), problem);
        let grid = member.grid.as_ref();
        let grid = grid.ok_or_else(|| fail("expected an array of numbers".into()))?;
        let size = |shape: &mut dyn Iterator<Item = u64>| {
            shape.fold(grid.scalar.size() as u64, |size, extent| size.saturating_mul(extent))
        };
        let all = size(&mut member.shape.iter().map(|&extent| extent as u64));
        let part = grid.part(axes, step).map(|part| part.len() as u64);
        let length = part.unwrap_or(u64::MAX);
        let chunk = member.dataset.chunk_shape().map_err(|error| fail(describe(&error)))?;
        let chunk = chunk.map_or(0, |shape| size(&mut shape.into_iter()));
        if all.max(chunk) > self.packed.saturating_mul(DEFLATE_RATIO) {
            let (length, packed) = (all.max(chunk), self.packed);
            return Err(fail(format!("{length} bytes cannot be in a file of {packed}")));
        }
        self.count(&path, length)?;
        memory::probe(usize::try_from(length.max(chunk)).unwrap_or(usize::MAX), path.display())?;
        let rows = if length < all { step..step + 1 } else { 0..member.rows() };
        check_chunks(member, rows).map_err(fail)?;
        let bytes = match length < all {
            true => member.dataset.read_raw_rows(step as u64, 1),
            false => member.dataset.read_raw(),
        };
        let bytes = bytes.map_err(|error| fail(describe(&error)))?;
        if bytes.len() as u64 != length {
            return Err(fail(format!("expected {length} bytes, found {}", bytes.len())));
        }
        Ok((bytes, grid))
    }

    /// Path of an array for messages.
    fn display_path(&self, place: &str, name: &str) -> PathBuf {
        let place = format!("{}/{name}", place.trim_end_matches('/'));
        format!("{} ({})", self.path.display(), printable(place)).into()
    }

    /// Counts the bytes read from the file; fails beyond the limit.
    fn count(&mut self, path: &Path, bytes: u64) -> Result<()> {
        self.budget.take(bytes, path, Location::Byte(0))
    }

    fn damaged(&self, place: &str, error: &hdf5_pure::Error) -> Error {
        let problem = format!("{}: {}", printable(place.into()), describe(error));
        Error::malformed(self.path, Location::Byte(0), problem)
    }
}

/// Fails if some of these rows of an array have no chunk, or if a chunk is not of the array's grid: the decoder would put
/// zeros there.
fn check_chunks(member: &Member, rows: Range<usize>) -> Result<(), String> {
    let dataset = &member.dataset;
    let (Ok(Some(sizes)), false) = (dataset.chunk_shape(), rows.is_empty()) else { return Ok(()) };
    if sizes.contains(&0) {
        return Err(format!("chunks of {sizes:?}"));
    }
    // One kind of index cannot be listed.
    let Ok(chunks) = dataset.chunks() else { return Ok(()) };
    let shape: Vec<u64> = member.shape.iter().map(|&extent| extent as u64).collect();
    let mut found = BTreeSet::new();
    for chunk in chunks {
        let mut axes = chunk.offset.iter().zip(&shape).zip(&sizes);
        let inside = |((at, extent), size): ((&u64, &u64), &u64)| at < extent && at % size == 0;
        if !axes.all(inside) {
            return Err(format!("a chunk at {:?} of an array of {shape:?}", chunk.offset));
        }
        found.insert(chunk.offset);
    }
    let [first, last] = [rows.start, rows.end - 1].map(|row| row as u64 / sizes[0]);
    let there = found.iter().filter(|at| (first..=last).contains(&(at[0] / sizes[0]))).count();
    let others = shape.iter().zip(&sizes).skip(1).map(|(extent, &size)| extent.div_ceil(size));
    let expected = others.fold(last - first + 1, u64::saturating_mul);
    if there as u64 != expected {
        return Err(format!("{there} of {expected} chunks were written"));
    }
    Ok(())
}

/// An error of the decoder, on one line.
fn describe(error: &hdf5_pure::Error) -> String {
    /// Largest number of characters.
    const MOST: usize = 300;
    let text = printable(error.to_string());
    let unsupported = matches!(
        error,
        hdf5_pure::Error::Format(
            FormatError::UnsupportedFilter(_)
                | FormatError::UnsupportedZfp(_)
                | FormatError::UnsupportedVirtualLayout
                | FormatError::InvalidLayoutVersion(_)
                | FormatError::UnsupportedExternalStorage
        )
    ) || text.contains("cannot be enumerated");
    let remedy = if unsupported { "; `h5repack -f NONE IN.h5 OUT.h5` unpacks it" } else { "" };
    format!("{text:.MOST$}{remedy}")
}

/// An array of a group; `None` if its shape cannot be read.
fn member(name: String, dataset: Dataset) -> Option<Member> {
    let shape = dataset.shape().ok()?;
    let shape: Vec<usize> =
        shape.into_iter().map(usize::try_from).collect::<Result<_, _>>().ok()?;
    let grid = number_of(&dataset).map(|(scalar, big_endian)| Grid {
        sizes: shape.clone(),
        columns_first: false,
        scalar,
        big_endian,
    });
    Some(Member { name, dataset, shape, grid })
}

/// Whether the name of a group says that its particles are liquid.
fn is_liquid(name: &str) -> bool {
    says(name, &["fluid", "liquid", "water"])
}

/// Whether the name of a group says that its particles are solid.
fn is_solid(name: &str) -> bool {
    says(name, &["solid", "bound", "wall", "tank", "body", "rigid", "obstacle", "gate"])
}

fn says(name: &str, words: &[&str]) -> bool {
    let name = name.to_ascii_lowercase();
    words.iter().any(|word| name.contains(word))
}

/// Divides bodies into liquids and solids by their names; where all particles are selected, all are liquid.
fn sorted(bodies: Vec<Body>, select: &Selection) -> (Vec<Body>, Vec<Body>) {
    let named = bodies.iter().any(|body| is_liquid(&body.name));
    let liquid = |body: &Body| match (select, named) {
        (Selection::All, _) => true,
        (_, true) => is_liquid(&body.name),
        (_, false) => !is_solid(&body.name),
    };
    bodies.into_iter().partition(liquid)
}

/// The type of a dataset's numbers, and whether they are big-endian; `None` for types that are none of IEEE 754's
/// or whole numbers of a few bytes.
fn number_of(dataset: &Dataset) -> Option<(Scalar, bool)> {
    const HALF: FloatingPointLayout = FloatingPointLayout {
        bit_offset: 0,
        bit_precision: 16,
        exponent_location: 10,
        exponent_size: 5,
        mantissa_location: 0,
        mantissa_size: 10,
        exponent_bias: 15,
    };
    let (order, scalar) = match dataset.datatype().ok()? {
        Datatype::FloatingPoint { size, byte_order, layout } => {
            let scalar = match size {
                2 if layout == HALF => Scalar::F16,
                4 if layout == FloatingPointLayout::IEEE754_BINARY32 => Scalar::F32,
                8 if layout == FloatingPointLayout::IEEE754_BINARY64 => Scalar::F64,
                _ => return None,
            };
            (byte_order, scalar)
        }
        Datatype::FixedPoint { size, byte_order, layout } => {
            let FixedPointLayout { signed, bit_offset, bit_precision } = layout;
            if bit_offset != 0 || u32::from(bit_precision) != size.saturating_mul(8) {
                return None;
            }
            let scalar = match (size, signed) {
                (1, true) => Scalar::I8,
                (1, false) => Scalar::U8,
                (2, true) => Scalar::I16,
                (2, false) => Scalar::U16,
                (4, true) => Scalar::I32,
                (4, false) => Scalar::U32,
                (8, true) => Scalar::I64,
                (8, false) => Scalar::U64,
                _ => return None,
            };
            (byte_order, scalar)
        }
        _ => return None,
    };
    match order {
        DatatypeByteOrder::LittleEndian => Some((scalar, false)),
        DatatypeByteOrder::BigEndian => Some((scalar, true)),
        DatatypeByteOrder::Vax => None,
    }
}

/// The problem of positions that have a usual name and shape, but numbers of a type that is not read.
fn unusual_positions(members: &[Member]) -> Option<String> {
    let unusual = |member: &&Member| member.grid.as_ref().is_none_or(|grid| !grid.may_be_places());
    let known = |member: &&Member| {
        POSITIONS.iter().any(|known| member.name.eq_ignore_ascii_case(known))
            && matches!(member.shape.as_slice(), [_, 2 | 3] | [_, _, 2 | 3])
    };
    let member = members.iter().filter(unusual).find(known)?;
    let kind = match member.dataset.datatype() {
        Ok(Datatype::FloatingPoint { size, .. }) => {
            format!("floats of {size} bytes that are not IEEE 754's")
        }
        Ok(Datatype::FixedPoint { size, .. }) => format!("integers of {size} bytes"),
        _ => "data of another type".into(),
    };
    let name = printable(member.name.clone());
    Some(format!("{name} has {kind}; expected IEEE floats, or integers of 2 to 8 bytes"))
}

/// The arrays that are columns of one number a particle, chosen by `among` by their names.
fn columns_among(
    members: &[Member],
    is_column: impl Fn(&Member) -> bool,
    among: impl Fn(&[&str]) -> Option<Vec<usize>>,
) -> Option<Vec<usize>> {
    let columns: Vec<_> = (0..members.len()).filter(|&at| is_column(&members[at])).collect();
    let names: Vec<_> = columns.iter().map(|&at| members[at].name.as_str()).collect();
    Some(among(&names)?.into_iter().map(|k| columns[k]).collect())
}
