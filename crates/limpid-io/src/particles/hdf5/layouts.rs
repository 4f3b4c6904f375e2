//! Where the particles are in a file, by simulator.

use hdf5_pure::{AttrValue, File, Group};

use super::super::vtk::is_point;
use super::super::{Attribute, Contents, Remark, Selection, Unit, pieces, several};
use super::Archive;
use super::member::{Member, member, unusual_positions};
use crate::error::{Error, Location, Result, printable};

/// Liquid or solid particles under `particles`.
pub(super) struct Body {
    pub(super) name: String,
    pub(super) place: String,
    pub(super) members: Vec<Member>,
}

impl Archive<'_> {
    /// Reads the particles in whichever layout the file has.
    pub(super) fn read(&mut self, file: &File) -> Result<Contents> {
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
                (None, _) => return Err(several(self.path)),
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

    /// The groups of time steps with their numbers, as `Step#0` of H5Part, in order; `None` if there are none.
    pub(super) fn numbered(
        &self,
        root: &Group,
        groups: &[String],
    ) -> Result<Option<Vec<(i64, String)>>> {
        /// Names of a step, before its number.
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
    pub(super) fn bodies(&self, group: &Group) -> Result<Vec<Body>> {
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
    pub(super) fn plain(&self, root: &Group, groups: &[String]) -> Result<(String, Vec<Member>)> {
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
pub(super) fn sorted(bodies: Vec<Body>, select: &Selection) -> (Vec<Body>, Vec<Body>) {
    let named = bodies.iter().any(|body| is_liquid(&body.name));
    let liquid = |body: &Body| match (select, named) {
        (Selection::All, _) => true,
        (_, true) => is_liquid(&body.name),
        (_, false) => !is_solid(&body.name),
    };
    bodies.into_iter().partition(liquid)
}
