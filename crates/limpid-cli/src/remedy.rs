//! Remedies for errors and notices, in terms of this program's options.

use std::io::ErrorKind;

use limpid::error::Limited;
use limpid_io::Error;
use limpid_io::error::Unpacked;
use limpid_io::input::Missing;
use limpid_io::notice::Notice;
use limpid_io::particles::Remark;

/// The line that reports an error, with its remedy.
pub(crate) fn with_remedy(error: &Error) -> String {
    match error {
        Error::Input { input, source } => format!("{input}: {}", with_remedy(source)),
        Error::Frame { frame, source } => {
            let problem = format!("frame {frame}: {}", with_remedy(source));
            let goes_on = source.is_of_reading() && !problem.contains("; to continue: ");
            joined(
                &problem,
                goes_on.then_some("to continue: --missing hold or empty, or --keep-going"),
            )
        }
        Error::Shared(error) => with_remedy(error),
        Error::Override { problem, .. } if problem.ends_with('?') => format!("--set {error}"),
        Error::Override { .. } => format!("--set {error}; `limpid settings` lists all"),
        Error::Render(error) => of_drawing(error),
        _ => joined(&error.to_string(), of_file(error).as_deref()),
    }
}

/// As [`with_remedy`], for an error of the renderer.
pub(crate) fn of_drawing(error: &limpid::Error) -> String {
    let remedy = match error {
        limpid::Error::NoAdapter => {
            "install a Vulkan driver, or Mesa's software one (Debian: apt-get install \
             mesa-vulkan-drivers)"
        }
        limpid::Error::Limit { of: Limited::Picture, .. } => "--size sets it",
        limpid::Error::Limit { of: Limited::Classify, .. } => "--set classify.on=auto or cpu",
        _ => return error.to_string(),
    };
    joined(&error.to_string(), Some(remedy))
}

/// The remedy for an error of `limpid-io`.
fn of_file(error: &Error) -> Option<String> {
    Some(match error {
        Error::TooLarge { what: Unpacked::Meshes, .. } => "make its pictures smaller".into(),
        Error::TooLarge { what: Unpacked::Instances, .. } => "export fewer instances".into(),
        Error::TooLarge { .. } => "--max-unpacked MIB allows more".into(),
        Error::Unplaced { .. } => "--skip-invalid leaves them out".into(),
        Error::MissingFrame { .. } | Error::MissingFrames { .. } => {
            "to continue: --missing empty or hold".into()
        }
        Error::NotBaked { scene } => format!("run: limpid bake {scene}"),
        Error::OtherBake { .. } => {
            "bake with --restart to replace them, or into another folder with -o".into()
        }
        Error::UnknownBake { .. } => {
            "remove them yourself, or bake into another folder with -o".into()
        }
        Error::UnknownRadius { .. } => "give --radius".into(),
        Error::Io { action: "write", source, .. } if source.kind() == ErrorKind::StorageFull => {
            "free some space, or write elsewhere".into()
        }
        Error::Window(_) => "`limpid render` draws without one".into(),
        Error::Threads(_) => {
            "raise its limits (`ulimit -u`, `ulimit -v`) or end other programs, and try again"
                .into()
        }
        _ => return None,
    })
}

/// The line that reports a notice, with its remedy.
pub(crate) fn of_notice(notice: &Notice) -> String {
    const VIEW: &str = "--camera moves the view, and a scene without [camera] fits it";
    let remedy = match notice {
        Notice::Read(remark) => return of_remark(remark),
        Notice::Gaps(_, Some(Missing::Error)) => "--missing hold or empty fills the gaps".into(),
        Notice::Rate(_) => "set them with --fps, or fps in the scene's [particles]".into(),
        Notice::MaybeRadius(array) if is_diameter(array) => {
            format!("if it is the diameter: --map 'diameter={array}'")
        }
        Notice::MaybeRadius(array) => format!("if it is the radius: --map radius={array}"),
        Notice::Crowded(_) | Notice::Scattered(_) | Notice::Vanishing(_) => {
            "if the places are not in metres: --scale 0.001 for millimetres; if the radius is wrong: --radius".into()
        }
        Notice::Opaque(_) => "if these are millimetres: --scale 0.001".into(),
        Notice::Unseen { .. } => "--camera moves the view and --camera-up y or z says in which axes it is, and a scene without [camera] fits it".into(),
        Notice::Outside(..) => VIEW.into(),
        Notice::Dots(_) => format!("if the radius is wrong: --radius; {VIEW}"),
        _ => return notice.to_string(),
    };
    joined(&notice.to_string(), Some(&remedy))
}

/// The line that reports a remark on a file, with its remedy.
pub(crate) fn of_remark(remark: &Remark) -> String {
    let remedy = match remark {
        Remark::Partial { .. } => Some(
            "to read all files as one, with {r} for their numbers: --merge 'snap_000.{r}.hdf5'",
        ),
        Remark::OwnRadii => Some("--map radius=none leaves them out"),
        Remark::LeftOut { .. } => Some("--select all keeps them"),
        Remark::OfOtherFrame { .. } => Some(
            "a source with {} for the frame's number, as foam_{}.bgeo, has files for all frames",
        ),
        Remark::NoneSelected { .. } => Some("`limpid info` lists the values of its arrays"),
        _ => None,
    };
    joined(&remark.to_string(), remedy)
}

/// Whether an array has a name of diameters.
fn is_diameter(array: &str) -> bool {
    array.eq_ignore_ascii_case("d") || array.to_ascii_lowercase().contains("diam")
}

fn joined(problem: &str, remedy: Option<&str>) -> String {
    match remedy {
        Some(remedy) => format!("{problem}; {remedy}"),
        None => problem.to_owned(),
    }
}
