//! Files of foam, spray, bubbles and dust: beside those of the liquid, or a scene's.

use std::sync::Arc;

use glam::Vec3;
use limpid::diffuse::{Diffuse, DiffuseKind};
use limpid::liquid::Up;

use super::fluid::{Fluid, FluidSource};
use crate::error::{Error, Result};
use crate::files;
use crate::particles::{AttributeMap, Remark, into_diffuse, reading_diffuse};
use crate::project::DiffuseSource;
use crate::sequence::{Missing, Sequence, companions_of};

/// A source of diffuse particles.
#[derive(Debug, Clone)]
pub(super) enum Source {
    Files(Box<DiffuseFiles>),
    /// Of the caller, with every frame.
    Given(Arc<Diffuse>),
}

/// Files of diffuse particles.
#[derive(Debug, Clone)]
pub(super) struct DiffuseFiles {
    /// The files, as those of a fluid whose axes and unit are its own.
    pub(super) files: Fluid,
    /// The fluid whose axes and unit are theirs.
    beside: Option<usize>,
    /// The kind of particles without one.
    kind: DiffuseKind,
    /// The kinds that are shown; all if empty.
    kinds: Vec<DiffuseKind>,
    color: Option<Vec3>,
    radius: Option<f32>,
    /// Whether it is one file, which a scene shows with its frame.
    single: bool,
}

impl DiffuseFiles {
    pub(super) fn new(sequence: Sequence, beside: Option<usize>, kind: DiffuseKind) -> Self {
        let mut files = Fluid::of_files(sequence, None, None, AttributeMap::default());
        files.options = reading_diffuse(&files.options);
        Self { files, beside, kind, kinds: Vec::new(), color: None, radius: None, single: false }
    }

    /// The files of a scene's table.
    fn of_scene(table: &DiffuseSource) -> Result<Self> {
        let sequence = Sequence::open(&table.source)?;
        let single = sequence.frames.len() == 1 && files::is_file(&table.source);
        let kind = table.kinds.first().copied().unwrap_or_default();
        let (color, radius, kinds) = (table.color, table.radius, table.kinds.clone());
        Ok(Self { kinds, color, radius, single, ..Self::new(sequence, Some(0), kind) })
    }

    /// The table of a scene with these fluids that reads them.
    ///
    /// # Errors
    /// [`Error::Usage`] if their axes or their unit are not the first fluid's.
    pub(super) fn table(&self, fluids: &[Fluid]) -> Result<DiffuseSource> {
        let pattern = &self.files.sequence.pattern;
        let axes = |fluid: Option<&Fluid>| fluid.map_or((Up::Y, 1.0), |of| (of.up, of.scale));
        if axes(self.beside.and_then(|fluid| fluids.get(fluid))) != axes(fluids.first()) {
            let problem = format!(
                "{pattern}: a scene reads whitewater with the axes and the unit of its first fluid; give all files the same"
            );
            return Err(Error::Usage(problem));
        }
        let mut kinds = self.kinds.clone();
        if kinds.is_empty() && self.kind != DiffuseKind::default() {
            // The first kind is that of particles without one.
            kinds.push(self.kind);
            kinds.extend(DiffuseKind::ALL.iter().filter(|&&kind| kind != self.kind));
        }
        Ok(DiffuseSource { source: pattern.into(), color: self.color, kinds, radius: self.radius })
    }

    /// The number of the file that belongs to a frame of the liquid, whose scene selects `selected`.
    pub(super) fn number(&self, frame: i64, selected: Option<i64>) -> Option<i64> {
        let sequence = &self.files.sequence;
        match sequence.frames.as_slice() {
            [own] if self.single => selected.is_none_or(|own| own == frame).then_some(own.number),
            _ => sequence.frame(frame).map(|frame| frame.number),
        }
    }

    /// The remark that a scene's one file is not shown with a frame, if it is not.
    pub(super) fn passed_over(&self, frame: i64, selected: Option<i64>) -> Option<Remark> {
        let own = selected.filter(|&own| self.single && own != frame)?;
        let name = self.files.sequence.frames.first()?.path.file_name()?;
        Some(Remark::OfOtherFrame { file: name.to_string_lossy().into_owned(), own })
    }

    /// How its particles are drawn.
    pub(super) fn described(&self) -> String {
        let Self { kind, kinds, color, radius, .. } = self;
        format!("{kind:?} {kinds:?} {color:?} {radius:?}")
    }

    /// Reads a file, y up in metres. `radius` is that of particles without one, m.
    pub(super) fn read(
        &self,
        number: i64,
        missing: Missing,
        fluids: &[Fluid],
        radius: f32,
        remarks: &mut Vec<Remark>,
    ) -> Result<Diffuse> {
        let (_, contents) = self.files.contents(number, missing)?;
        let liquid = self.beside.and_then(|fluid| fluids.get(fluid));
        let scale = liquid.map_or(1.0, |liquid| liquid.scale);
        let radius = self.radius.unwrap_or(radius) / scale as f32;
        let (mut diffuse, found) = into_diffuse(contents, self.kind, radius);
        remarks.extend(found);
        if let Some(liquid) = liquid {
            diffuse.to_y_up(liquid.up);
            diffuse.scale(scale);
        }
        if !self.kinds.is_empty() {
            let kinds = diffuse.kinds.clone();
            diffuse.retain(|i| self.kinds.contains(&kinds[i]));
        }
        for kind in DiffuseKind::ALL {
            let shown = self.kinds.is_empty() || self.kinds.contains(&kind);
            if let Some(color) = self.color.filter(|_| shown) {
                diffuse.colors[kind as usize] = color;
            }
        }
        Ok(diffuse)
    }
}

/// The files beside the frames of some fluids.
pub(super) fn beside(fluids: &[Fluid]) -> Vec<Source> {
    let of_files = |(_, fluid): &(usize, &Fluid)| matches!(fluid.source, FluidSource::Files);
    let companions = fluids.iter().enumerate().filter(of_files).flat_map(|(i, fluid)| {
        let first = fluid.sequence.frames.first();
        let found = first.map(|frame| companions_of(&frame.path)).unwrap_or_default();
        found.into_iter().filter_map(move |(path, kind)| {
            // Files that are none are left alone.
            Some(DiffuseFiles::new(Sequence::open(path).ok()?, Some(i), kind))
        })
    });
    companions.map(|files| Source::Files(Box::new(files))).collect()
}

/// The files of a scene's tables.
///
/// # Errors
/// As [`Sequence::open`].
pub(super) fn of_scene(tables: &[DiffuseSource]) -> Result<Vec<Source>> {
    let files = tables.iter().map(DiffuseFiles::of_scene);
    files.map(|files| Ok(Source::Files(Box::new(files?)))).collect()
}
