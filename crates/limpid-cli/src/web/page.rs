//! The page for browsers, which `scripts/web.sh` builds.

use std::io;
use std::path::{Path, PathBuf};

use limpid_io::{Error, Result};

use super::scene_files::SCENE;
use super::site::Site;

/// Its files that a site needs, and the one that shows the scene.
const FILES: [&str; 5] =
    ["limpid.js", "limpid_web.js", "limpid_web_bg.wasm", "still.jpg", "worker.js"];
const INDEX: &str = "index.html";

/// The element that shows what the page's address names.
const ELEMENT: &str = "<limpid-view controls address";

/// The folder of the page: the given one, or else `page` beside the program, `share/limpid/page` of its installation, or
/// `web/dist` of the repository that it was built in, or in which it runs.
///
/// # Errors
/// [`Error::Usage`] if there is none; [`Error::Io`] for a file that the given one lacks.
pub(super) fn find(given: Option<&Path>) -> Result<PathBuf> {
    if let Some(given) = given {
        let lacks = |name: &&str| !given.join(name).is_file();
        return match FILES.into_iter().chain([INDEX]).find(lacks) {
            Some(name) => {
                let problem = "it is not there, and a page that scripts/web.sh has built has it";
                let missing = io::Error::new(io::ErrorKind::NotFound, problem);
                Err(Error::io(&given.join(name), "read", missing))
            }
            None => Ok(given.to_owned()),
        };
    }
    let program = std::env::current_exe().and_then(|program| program.canonicalize());
    let here = std::env::current_dir();
    let program = program.unwrap_or_default();
    let beside = program.parent().unwrap_or(Path::new(""));
    let installed = [beside.join("page"), beside.join("../share/limpid/page")];
    let here = here.unwrap_or_default();
    let repositories = program.ancestors().chain(here.ancestors());
    let mut all = installed.into_iter().chain(repositories.map(|folder| folder.join("web/dist")));
    all.find(|folder| find(Some(folder)).is_ok()).ok_or_else(|| {
        let problem = "the page for browsers is not built: run scripts/web.sh in limpid's repository, and name the \
                       folder that it makes: --page web/dist";
        Error::Usage(problem.into())
    })
}

/// Puts the page into a site, whose scene it opens; `plays` for a sequence.
///
/// # Errors
/// [`Error::Usage`] for the page of another version; as [`Site::copy`].
pub(super) fn add(site: &mut Site, page: &Path, plays: bool) -> Result<()> {
    for name in FILES {
        site.copy(&page.join(name), name)?;
    }
    let path = page.join(INDEX);
    let index = std::fs::read_to_string(&path).map_err(|e| Error::io(&path, "read", e))?;
    if !index.contains(ELEMENT) {
        let (path, version) = (path.display(), env!("CARGO_PKG_VERSION"));
        let problem = format!("{path}: it is not the page of limpid {version}: run scripts/web.sh");
        return Err(Error::Usage(problem));
    }
    let plays = if plays { " play" } else { "" };
    let index = index.replacen(ELEMENT, &format!("{ELEMENT} src=\"{SCENE}\"{plays}"), 1);
    site.write(INDEX, index.as_bytes())
}
