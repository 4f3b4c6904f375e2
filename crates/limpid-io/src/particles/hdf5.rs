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
//! The crate `hdf5-pure` decodes. Sizes that a file claims are held against its length before memory is asked for.

mod adapt;
mod layouts;
mod member;
mod steps;

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use hdf5_pure::{File, FormatError, Group, ReadSeekSource};

use self::adapt::Link;
use self::member::{Member, check_chunks, columns_among, member, unusual_positions};
use super::axes::{Axes, Grid, Places};
use super::labelled::{position_among, velocity_among};
use super::npz::{POSITIONS, is_time, positions_among};
use super::{
    Attribute, Column, Contents, FileBytes, Reading, Remark, Table, attribute_names, foreign,
};
use crate::budget::Budget;
use crate::error::{Error, Location, Result, printable};
use crate::files::{self, DEFLATE_RATIO};
use limpid::memory;

pub(super) use self::steps::{Steps, read_step, steps};

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

    /// The groups of a group.
    fn groups(&self, place: &str, group: &Group) -> Result<Vec<String>> {
        group.groups().map_err(|error| self.damaged(place, &error))
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
            self.take_velocity(&mut contents, place, members, fields, &places, step)?;
        }
        contents.remarks.extend(self.unfollowed(place));
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
            let shows = self.reading.shows_or_describes(name);
            let axes = match attribute {
                Some(attribute) => grid.and_then(|grid| grid.attribute(attribute, &places)),
                None if keeps => grid.and_then(|grid| grid.axes_of(1, &places)),
                None if shows => grid.and_then(|grid| grid.shown(&places)),
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
                Err(_) if attribute.is_none() && !self.reading.wants(name) => {
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

    /// Takes velocities from an array for each axis.
    fn take_velocity(
        &mut self,
        contents: &mut Contents,
        place: &str,
        members: &[Member],
        fields: &[usize],
        places: &Places,
        step: usize,
    ) -> Result<()> {
        let names: Vec<_> = fields.iter().map(|&at| members[at].name.as_str()).collect();
        let name = names.join(" ");
        let path = self.display_path(place, &name);
        let (table, columns) = self.columns(&path, place, members, fields, places, step)?;
        let shape = [table.rows, columns.len()];
        self.count(&path, Attribute::Velocity.bytes().saturating_mul(table.rows as u64))?;
        for (&at, column) in fields.iter().zip(&columns) {
            contents.keep(&self.reading, &members[at].name, &table, &[*column])?;
        }
        contents.take_as(Some(Attribute::Velocity), &name, &shape, &table, &columns)
    }

    /// Attributes that are links to other files, which are not followed.
    fn unfollowed(&self, place: &str) -> Vec<Remark> {
        let remark = |link: &Link| {
            let (file, attribute) =
                (link.file.as_ref()?, self.reading.map.attribute_of(&link.name)?);
            Some(Remark::Unusable {
                array: printable(link.name.clone()),
                problem: format!("{attribute} is in the file {}", printable(file.clone())),
            })
        };
        self.links_of(place).filter_map(remark).collect()
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

    fn no_step(&self, steps: usize) -> Error {
        let step = self.step.unwrap_or(0);
        let problem = format!("step {step}: the file has {steps} now");
        Error::malformed(self.path, Location::Byte(0), problem)
    }

    fn damaged(&self, place: &str, error: &hdf5_pure::Error) -> Error {
        let problem = format!("{}: {}", printable(place.into()), describe(error));
        Error::malformed(self.path, Location::Byte(0), problem)
    }
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
