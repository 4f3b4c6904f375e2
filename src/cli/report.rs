//! `limpid report`.

use std::path::PathBuf;
use std::process::ExitCode;

use limpid::gpu::Gpu;
use limpid::output;
use limpid::report::{self, Kind, Options};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder for report.json, report.html and report.md.
    #[arg(long, default_value = "report")]
    out: PathBuf,
    /// Small pictures and few methods: under two minutes on two cores without a GPU.
    #[arg(long)]
    quick: bool,
    /// Write the JSON to this file instead.
    #[arg(long, value_name = "FILE.json")]
    json: Option<PathBuf>,
    /// Scenes to report on, by their names in sims/ [default: all].
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    scenes: Vec<String>,
    /// Width of the traced pictures, pixels [default: 1024, or 320 with --quick].
    #[arg(long, value_parser = clap::value_parser!(u32).range(16..=8192))]
    width: Option<u32>,
    /// Measurements: intersect, smooth, caustics, picture (with its passes) [default: all].
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = parse_kind)]
    kinds: Vec<Kind>,
}

fn parse_kind(text: &str) -> Result<Kind, String> {
    match text {
        "intersect" => Ok(Kind::Intersect),
        "smooth" => Ok(Kind::Smooth),
        "caustics" => Ok(Kind::Caustics),
        "picture" => Ok(Kind::Picture),
        _ => Err("there are intersect, smooth, caustics and picture".into()),
    }
}

pub(crate) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let gpu = Gpu::headless()?;
    let (scenes, kinds) = (args.scenes.clone(), args.kinds.clone());
    let options = Options { quick: args.quick, width: args.width, scenes, kinds };
    let report = report::measure(&gpu, &options, &mut |step| eprintln!("report: {step}"))?;
    std::fs::create_dir_all(&args.out)
        .map_err(|e| anyhow::anyhow!("{}: cannot create the folder: {e}", args.out.display()))?;
    let write = |path: &std::path::Path, text: &str| {
        output::write_atomically(path, |file| std::io::Write::write_all(file, text.as_bytes()))
    };
    let json = args.json.clone().unwrap_or_else(|| args.out.join("report.json"));
    write(&json, &serde_json::to_string_pretty(&report)?)?;
    write(&args.out.join("report.html"), &report::html(&report))?;
    write(&args.out.join("report.md"), &report::markdown(&report))?;
    for figure in &report.figures {
        for (number, (_, picture)) in figure.panels.iter().enumerate() {
            let name = format!("{}-{number}.png", figure.scene.replace(':', "-"));
            output::write_atomically(&args.out.join(name), |file| {
                picture.write_to(file, image::ImageFormat::Png).map_err(std::io::Error::other)
            })?;
        }
    }
    println!("{}", args.out.join("report.html").display());
    Ok(ExitCode::SUCCESS)
}
