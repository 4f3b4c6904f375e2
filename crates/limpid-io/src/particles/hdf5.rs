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

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use hdf5_pure::{AttrValue, DType, Dataset, Datatype, DatatypeByteOrder, File, FormatError, Group};

use super::labelled::{POSITION, canonical, vector_among};
use super::npz::positions_among;
use super::vtk::is_point;
use super::{
    Attribute, AttributeMap, Column, Contents, FileBytes, Particles, Reading, Scalar, Table,
    attribute_names, foreign,
};
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
    let mut archive = Archive {
        path,
        packed: bytes.len() as u64,
        limit: reading.limit,
        used: 0,
        map: reading.map,
    };
    // It is young (0.47), and some of its sums are unchecked: with overflow checks a damaged file could end
    // the program.
    files::catch_panics(path, || archive.read(copy))
}

/// A file, with a limit of its unpacked size.
struct Archive<'a> {
    path: &'a Path,
    /// Size of the file, bytes.
    packed: u64,
    /// Limit of the unpacked arrays and the attributes read from them, bytes.
    limit: u64,
    /// Their size so far, bytes.
    used: u64,
    map: &'a AttributeMap,
}

/// An array of a group.
struct Member {
    name: String,
    dataset: Dataset,
    /// Its size along each axis.
    shape: Vec<usize>,
    /// The type of its numbers, and whether they are big-endian; `None` for other data.
    number: Option<(Scalar, bool)>,
}

impl Member {
    /// Whether it has three floats per particle.
    fn is_triple(&self) -> bool {
        let float = matches!(self.number, Some((Scalar::F32 | Scalar::F64, _)));
        float && matches!(self.shape.as_slice(), [_, 3])
    }

    /// Whether it has one number per particle.
    fn is_column(&self) -> bool {
        self.number.is_some() && self.shape.len() == 1
    }

    /// Number of numbers per particle, if each has a list of them.
    fn width(&self) -> Option<usize> {
        match self.shape.as_slice() {
            [_] => Some(1),
            &[_, width] => Some(width),
            _ => None,
        }
    }
}

impl Archive<'_> {
    fn read(&mut self, bytes: Vec<u8>) -> Result<Contents> {
        let file = File::from_bytes(bytes).map_err(|error| self.damaged("/", &error))?;
        let root = file.root();
        let groups = root.groups().map_err(|error| self.damaged("/", &error))?;
        let has = |name: &str| groups.iter().any(|group| group == name);
        let group = |name: &str| file.group(name).map_err(|error| self.damaged(name, &error));
        if has("VTKHDF") {
            let group = group("VTKHDF")?;
            return self.vtkhdf(&group);
        }
        if has("PartType0") {
            let group = group("PartType0")?;
            return self.group("PartType0", &group, &[]);
        }
        if has("particles") {
            let group = group("particles")?;
            if let Some(contents) = self.pysph(&group)? {
                return Ok(contents);
            }
        }
        self.plain(&root, &groups)
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
        let data = child("PointData")?;
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
        if let Some(types) = members.iter().find(|m| m.name == "Types" && m.is_column()) {
            let types = self.numbers(place, types)?;
            cells += types.iter().filter(|&&kind| !is_point(Some(kind as i64))).count();
        }
        members.retain(|member| member.name == "Points");
        if let Some(data) = data {
            members.extend(self.members("VTKHDF/PointData", &data)?);
        }
        let contents = self.take(place, &members, &[])?;
        Ok(Contents { cells, ..contents })
    }

    /// Reads the output of `PySPH`, whose groups are the bodies; `None` if this is none. Those of solids
    /// are listed as ignored arrays.
    fn pysph(&mut self, group: &Group) -> Result<Option<Contents>> {
        let place = "particles";
        let names = group.groups().map_err(|error| self.damaged(place, &error))?;
        let mut bodies = Vec::new();
        for name in names {
            let body = group.group(&name).map_err(|error| self.damaged(place, &error))?;
            // Without its arrays it is none of `PySPH`.
            if let Ok(arrays) = body.group("arrays") {
                bodies.push((name, arrays));
            }
        }
        if bodies.is_empty() {
            return Ok(None);
        }
        let says = |name: &str, words: &[&str]| {
            let name = name.to_ascii_lowercase();
            words.iter().any(|word| name.contains(word))
        };
        let is_liquid = |name: &str| says(name, &["fluid", "liquid", "water"]);
        let is_solid = |name: &str| {
            says(name, &["solid", "bound", "wall", "tank", "body", "rigid", "obstacle", "gate"])
        };
        let named = bodies.iter().any(|(name, _)| is_liquid(name));
        let (liquids, solids): (Vec<_>, Vec<_>) = bodies
            .into_iter()
            .partition(|(name, _)| if named { is_liquid(name) } else { !is_solid(name) });
        if liquids.is_empty() {
            let names: Vec<_> =
                solids.iter().take(8).map(|(name, _)| printable(name.clone())).collect();
            let problem = format!("only solids ({}), no liquid", names.join(", "));
            return Err(Error::format(self.path, problem));
        }
        let mut contents: Option<Contents> = None;
        let mut parts = Vec::new();
        for (name, arrays) in &liquids {
            let place = format!("particles/{name}/arrays");
            let mut part = self.group(&place, arrays, &["u", "v", "w"])?;
            parts.push(std::mem::take(&mut part.particles));
            contents.get_or_insert(part);
        }
        let mut contents = contents.unwrap_or_default();
        let count: usize = parts.iter().map(Particles::len).sum();
        memory::probe(count.saturating_mul(Particles::MATCHED), self.path.display())?;
        contents.particles = match parts.len() {
            1 => parts.remove(0),
            _ => Particles::joined(&parts),
        };
        for (name, arrays) in &solids {
            let members = self.members(name, arrays)?;
            let count = members.iter().find(|member| member.name == "x");
            let count = count.and_then(|member| member.shape.first().copied()).unwrap_or(0);
            contents.list(name, &[count, 3], None);
        }
        Ok(Some(contents))
    }

    /// Reads arrays without a known layout: of the root, or of the only group that has positions.
    fn plain(&mut self, root: &Group, groups: &[String]) -> Result<Contents> {
        /// Largest number of groups to look into.
        const MOST: usize = 64;
        let members = self.members("/", root)?;
        if self.positions_of(&members).is_some() {
            return self.take("/", &members, &[]);
        }
        let mut found = Vec::new();
        for name in groups.iter().take(MOST) {
            let group = root.group(name).map_err(|error| self.damaged(name, &error))?;
            let members = self.members(name, &group)?;
            if self.positions_of(&members).is_some() {
                found.push((name, members));
            }
        }
        if found.len() == 1 {
            let (name, members) = found.remove(0);
            return self.take(name, &members, &[]);
        }
        let problem = if found.is_empty() {
            let names = members.iter().map(|member| &member.name).chain(groups);
            let names: Vec<_> = names.take(8).map(|name| printable(name.clone())).collect();
            format!(
                "no PartType0, particles/NAME/arrays, VTKHDF, or array of positions of shape (n, 3); there \
                 are: {}",
                names.join(", ")
            )
        } else {
            let names: Vec<_> = found.iter().map(|(name, _)| printable((*name).clone())).collect();
            format!("positions in several groups: {}; keep one of them", names.join(", "))
        };
        Err(Error::format(self.path, problem))
    }

    fn group(&mut self, place: &str, group: &Group, velocity: &[&str]) -> Result<Contents> {
        let members = self.members(place, group)?;
        self.take(place, &members, velocity)
    }

    /// Lists the arrays of a group.
    fn members(&self, place: &str, group: &Group) -> Result<Vec<Member>> {
        let datasets = group.iter_datasets().map_err(|error| self.damaged(place, &error))?;
        let member = |(name, dataset): (String, Dataset)| {
            let shape = dataset.shape().ok()?;
            let shape = shape.into_iter().map(usize::try_from).collect::<Result<_, _>>().ok()?;
            let number = number_of(&dataset);
            Some(Member { name, dataset, shape, number })
        };
        Ok(datasets.filter_map(member).collect())
    }

    /// The array of the positions, or the columns of their coordinates.
    fn positions_of(&self, members: &[Member]) -> Option<Vec<usize>> {
        let triples = members.iter().enumerate().filter(|(_, member)| member.is_triple());
        let triples: Vec<_> = triples.map(|(at, member)| (at, member.name.as_str())).collect();
        if let Some(at) = positions_among(&triples, self.map) {
            return Some(vec![at]);
        }
        columns_among(members, &POSITION)
    }

    /// Reads positions and attributes from the arrays of a group; `velocity` names the columns of the
    /// velocities, if they are no array.
    fn take(&mut self, place: &str, members: &[Member], velocity: &[&str]) -> Result<Contents> {
        let Some(positions) = self.positions_of(members) else {
            let names: Vec<_> = members.iter().take(8).map(|m| printable(m.name.clone())).collect();
            let problem =
                format!("{place}: no positions of shape (n, 3); there are: {}", names.join(", "));
            return Err(Error::format(self.path, problem));
        };
        let path = self.display_path(place, &members[positions[0]].name);
        let (table, columns) = self.table(&path, place, members, &positions)?;
        // The positions take no more memory than their arrays.
        self.count(&path, table.bytes.len() as u64)?;
        let &[x, y, z] = columns.as_slice() else { return Ok(Contents::default()) };
        let mut contents = Contents::from(table.particles([x, y, z])?);
        drop(table);
        let find = |name: &&str| members.iter().position(|m| m.name == **name && m.is_column());
        let columns: Option<Vec<usize>> = velocity.iter().map(find).collect();
        let velocity = columns.filter(|columns| columns.len() == 3);
        let velocity = velocity.filter(|_| self.map.array_of(Attribute::Velocity).is_none());
        if let Some(fields) = &velocity {
            let names: Vec<_> = fields.iter().map(|&at| members[at].name.as_str()).collect();
            let fields = fields.as_slice();
            self.attribute(
                place,
                members,
                fields,
                &names.join(" "),
                Attribute::Velocity,
                &mut contents,
            )?;
        }
        let used =
            |at: usize| positions.contains(&at) || velocity.iter().flatten().any(|&f| f == at);
        for (at, member) in members.iter().enumerate().filter(|&(at, _)| !used(at)) {
            let has = |attribute: &Attribute| {
                attribute_names(&contents.particles).any(|has| has == attribute.name())
            };
            let attribute = self.map.attribute_of(&member.name).filter(|attribute| !has(attribute));
            match attribute.filter(|&attribute| member.width() == Some(attribute.width())) {
                Some(attribute) if member.number.is_some() => {
                    self.attribute(place, members, &[at], &member.name, attribute, &mut contents)?;
                }
                _ => contents.list(&member.name, &member.shape, None),
            }
        }
        Ok(contents)
    }

    /// Reads an attribute from an array, or from one column for each of its numbers.
    fn attribute(
        &mut self,
        place: &str,
        members: &[Member],
        fields: &[usize],
        name: &str,
        attribute: Attribute,
        contents: &mut Contents,
    ) -> Result<()> {
        let path = self.display_path(place, name);
        let (table, columns) = self.table(&path, place, members, fields)?;
        self.count(&path, attribute.bytes().saturating_mul(table.rows as u64))?;
        let shape = [table.rows, columns.len()];
        let shape = if columns.len() == 1 { &shape[..1] } else { &shape[..] };
        contents.take_as(Some(attribute), name, shape, &table, &columns)
    }

    /// The table of an array, or of several columns side by side; and its columns.
    fn table<'p>(
        &mut self,
        path: &'p Path,
        place: &str,
        members: &[Member],
        fields: &[usize],
    ) -> Result<(Table<'p>, Vec<Column>)> {
        let source = FileBytes { path, bytes: &[], text: false };
        let table = |bytes: Vec<u8>, rows: usize, stride: usize, big_endian: bool| Table {
            source,
            start: 0,
            bytes: Cow::Owned(bytes),
            rows,
            stride,
            big_endian,
            starts: None,
        };
        if let &[field] = fields {
            let member = &members[field];
            let (bytes, scalar, big_endian) = self.load(place, member)?;
            let width = member.width().unwrap_or(1);
            let rows = member.shape.first().copied().unwrap_or(0);
            let columns = Column::adjacent(0, width, scalar);
            return Ok((table(bytes, rows, width * scalar.size(), big_endian), columns));
        }
        let width = fields.len();
        let rows = fields.iter().filter_map(|&at| members[at].shape.first().copied());
        let (least, rows) = (rows.clone().min().unwrap_or(0), rows.max().unwrap_or(0));
        if least != rows {
            let problem =
                format!("columns of {least} and of {rows} numbers, expected as many of each");
            return Err(Error::malformed(path, Location::Byte(0), problem));
        }
        let stride = width * Scalar::F64.size();
        self.count(path, (rows as u64).saturating_mul(stride as u64))?;
        let mut bytes = memory::zeroed(rows.saturating_mul(stride), path.display())?;
        for (k, &at) in fields.iter().enumerate() {
            let numbers = self.numbers(place, &members[at])?;
            for (row, number) in bytes.chunks_exact_mut(stride).zip(numbers) {
                row[8 * k..][..8].copy_from_slice(&number.to_le_bytes());
            }
        }
        Ok((table(bytes, rows, stride, false), Column::adjacent(0, width, Scalar::F64)))
    }

    /// The numbers of a column.
    fn numbers(&mut self, place: &str, member: &Member) -> Result<Vec<f64>> {
        let (bytes, scalar, big_endian) = self.load(place, member)?;
        let column = Column { offset: 0, scalar };
        let numbers = bytes.chunks_exact(scalar.size()).map(|x| column.number(x, big_endian));
        Ok(memory::collect(numbers, self.path.display())?)
    }

    /// Unpacks an array to numbers in the file's byte order.
    fn load(&mut self, place: &str, member: &Member) -> Result<(Vec<u8>, Scalar, bool)> {
        let path = self.display_path(place, &member.name);
        let fail = |problem: String| Error::malformed(&path, Location::Byte(0), problem);
        let (scalar, big_endian) =
            member.number.ok_or_else(|| fail("expected an array of numbers".into()))?;
        let size = |shape: &mut dyn Iterator<Item = u64>| {
            shape.fold(scalar.size() as u64, |size, extent| size.saturating_mul(extent))
        };
        let length = size(&mut member.shape.iter().map(|&extent| extent as u64));
        let chunk = member.dataset.chunk_shape().map_err(|error| fail(describe(&error)))?;
        let chunk = chunk.map_or(0, |shape| size(&mut shape.into_iter()));
        if length.max(chunk) > self.packed.saturating_mul(DEFLATE_RATIO) {
            let (length, packed) = (length.max(chunk), self.packed);
            return Err(fail(format!("{length} bytes cannot be in a file of {packed}")));
        }
        self.count(&path, length)?;
        memory::probe(usize::try_from(length.max(chunk)).unwrap_or(usize::MAX), path.display())?;
        let bytes = member.dataset.read_raw().map_err(|error| fail(describe(&error)))?;
        if bytes.len() as u64 != length {
            return Err(fail(format!("expected {length} bytes, found {}", bytes.len())));
        }
        Ok((bytes, scalar, big_endian))
    }

    /// Path of an array for messages.
    fn display_path(&self, place: &str, name: &str) -> PathBuf {
        let place = format!("{}/{name}", place.trim_end_matches('/'));
        format!("{} ({})", self.path.display(), printable(place)).into()
    }

    /// Counts the bytes read from the file; fails beyond the limit.
    fn count(&mut self, path: &Path, bytes: u64) -> Result<()> {
        self.used = self.used.saturating_add(bytes);
        if self.used <= self.limit {
            return Ok(());
        }
        let (path, location, limit) = (path.to_owned(), Location::Byte(0), self.limit);
        Err(Error::TooLarge { path, location, what: "file", limit })
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
        )
    );
    let remedy = if unsupported { "; `h5repack -f NONE IN.h5 OUT.h5` unpacks it" } else { "" };
    format!("{text:.MOST$}{remedy}")
}

/// The type of a dataset's numbers, and whether they are big-endian.
fn number_of(dataset: &Dataset) -> Option<(Scalar, bool)> {
    let order = match dataset.datatype().ok()? {
        Datatype::FixedPoint { byte_order, .. } | Datatype::FloatingPoint { byte_order, .. } => {
            byte_order
        }
        _ => return None,
    };
    let big_endian = match order {
        DatatypeByteOrder::LittleEndian => false,
        DatatypeByteOrder::BigEndian => true,
        DatatypeByteOrder::Vax => return None,
    };
    let scalar = match dataset.dtype().ok()? {
        DType::I8 => Scalar::I8,
        DType::U8 => Scalar::U8,
        DType::I16 => Scalar::I16,
        DType::U16 => Scalar::U16,
        DType::I32 => Scalar::I32,
        DType::U32 => Scalar::U32,
        DType::I64 => Scalar::I64,
        DType::U64 => Scalar::U64,
        DType::F32 => Scalar::F32,
        DType::F64 => Scalar::F64,
        _ => return None,
    };
    Some((scalar, big_endian))
}

/// Finds the columns of a vector whose names begin with one of `bases`.
fn columns_among(members: &[Member], bases: &[&str]) -> Option<Vec<usize>> {
    let columns: Vec<_> = (0..members.len()).filter(|&at| members[at].is_column()).collect();
    let names: Vec<_> = columns.iter().map(|&at| canonical(&members[at].name)).collect();
    let found = vector_among(&names, bases)?;
    Some(found.into_iter().map(|k| columns[k]).collect())
}
