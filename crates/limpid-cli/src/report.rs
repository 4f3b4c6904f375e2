//! The command `limpid report`.

use std::path::PathBuf;

use limpid_io::device;
use limpid_io::input;
use limpid_io::output::{FileKind, Files};
use limpid_lab::report::against::Measured;
use limpid_lab::report::{self, Options, Output, RowKind};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder for report.json, report.html and report.md.
    #[arg(long, default_value = "report")]
    out: PathBuf,
    /// Small pictures and few methods: a few minutes on two cores without a GPU.
    #[arg(long)]
    quick: bool,
    /// Write the JSON to this file instead.
    #[arg(long, value_name = "FILE.json")]
    json: Option<PathBuf>,
    /// Scenes to measure, by name in sims/ [default: all]; with --passes also scene files.
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    scenes: Vec<String>,
    /// Width of the path-traced pictures, pixels [default: 1024, or 320 with --quick].
    #[arg(long, value_parser = clap::value_parser!(u32).range(16..=8192))]
    width: Option<u32>,
    /// Measurements: intersect, smooth, caustics, picture (with its passes), passes, elisions
    /// [default: all].
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = str::parse::<RowKind>)]
    kinds: Vec<RowKind>,
    /// Measure only the time of each pass against its budget: --kinds passes.
    #[arg(long)]
    passes: bool,
    /// Measure only the time saved by skipped work: --kinds elisions.
    #[arg(long)]
    elisions: bool,
    /// Compare the errors with those of an earlier report.json and list the increased ones; the exit
    /// code is 1 if any has increased by more than 1 %.
    #[arg(long, value_name = "FILE.json")]
    against: Option<PathBuf>,
    /// Measure only the table that `limpid render --max-error` and `--budget` select from, and write
    /// it to this file.
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["kinds", "passes", "elisions", "scenes", "json", "against"])]
    curve: Option<PathBuf>,
}

/// Exit code if an error has increased.
const INCREASED: u8 = 1;

pub(crate) fn run(args: &Args) -> anyhow::Result<u8> {
    let output = Output {
        folder: args.out.clone(),
        json: args.json.clone().unwrap_or_else(|| args.out.join("report.json")),
    };
    let earlier = args.against.as_deref().map(Measured::read).transpose()?;
    check_outputs(args, &output)?;
    let gpu = device::open()?;
    let mut progress = |step: &str| {
        if !crate::terminal::is_silent() {
            crate::terminal::print_line(&format!("report: {step}"));
        }
    };
    if let Some(path) = &args.curve {
        report::curve::write(path, &report::curve::measure(&gpu, &mut progress)?)?;
        println!("{}", path.display());
        return Ok(crate::SUCCESS);
    }
    let (scenes, mut kinds) = (args.scenes.clone(), args.kinds.clone());
    kinds.extend(args.passes.then_some(RowKind::Pass));
    kinds.extend(args.elisions.then_some(RowKind::Elision));
    let options = Options { quick: args.quick, width: args.width, scenes, kinds };
    let report = report::measure(&gpu, &options, &mut progress)?;
    output.write(&report)?;
    println!("{}", output.page().display());
    let Some(earlier) = earlier else { return Ok(crate::SUCCESS) };
    let against = Measured::of(&report).against(&earlier);
    println!("{against}");
    let increased = against.risen().next().is_some();
    Ok(if increased { INCREASED } else { crate::SUCCESS })
}

/// Checks the outputs before the measurements, which take minutes.
fn check_outputs(args: &Args, output: &Output) -> anyhow::Result<()> {
    let mut files = Files::default();
    let scenes = args.scenes.iter().flat_map(input::files_of);
    scenes.chain(args.against.clone()).for_each(|path| files.reads(&path));
    if let Some(path) = &args.curve {
        return Ok(files.writes(path, FileKind::CURVE)?);
    }
    std::fs::create_dir_all(&args.out)
        .map_err(|e| anyhow::anyhow!("{}: cannot create the folder: {e}", args.out.display()))?;
    Ok(output.check(&mut files)?)
}
