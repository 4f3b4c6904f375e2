//! Opening a source.

use std::path::Path;

use crate::model::document::Source;
use limpid_io::project::Project;

/// The project of a simulated source; `None` for all others, and for unreadable ones, whose error is
/// reported by opening them.
pub(crate) fn simulated(source: &Source) -> Option<Project> {
    let path = Path::new(&source.input);
    let scene = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"));
    let project = scene.then(|| Project::load(path).ok()).flatten()?;
    project.source.simulation().is_some().then_some(project)
}
