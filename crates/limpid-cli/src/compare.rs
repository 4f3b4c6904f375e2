//! The command `limpid compare`.

use std::path::PathBuf;

use limpid_io::output::Files;
use limpid_lab::compare::{self, FlipMap};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The reference picture (PNG).
    reference: PathBuf,
    /// The picture to test.
    test: PathBuf,
    /// Exit with code 1 if the mean FLIP exceeds this, 0 to 1.
    #[arg(long, value_name = "X", value_parser = parse_share)]
    max_flip: Option<f64>,
    /// Write a picture of the differences: .png, .jpg or .webp.
    #[arg(long, value_name = "D.png")]
    diff: Option<PathBuf>,
    /// Print machine-readable results.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<u8> {
    if let Some(path) = &args.diff {
        let mut files = Files::default();
        [&args.reference, &args.test].into_iter().for_each(|path| files.reads(path));
        FlipMap::check_output(path, &mut files)?;
    }
    let (comparison, map) = compare::compare_files(&args.reference, &args.test)?;
    if let Some(path) = &args.diff {
        map.write(path)?;
    }
    let text =
        if args.json { serde_json::to_string_pretty(&comparison)? } else { comparison.to_string() };
    crate::terminal::print(&text)?;
    let differs = args.max_flip.is_some_and(|max| comparison.mean_flip > max);
    Ok(u8::from(differs))
}

fn parse_share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| "expected 0 to 1".to_owned())
}
