//! `limpid compare`.

use std::path::PathBuf;
use std::process::ExitCode;

use limpid::{compare, output};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The reference picture (PNG).
    reference: PathBuf,
    /// The picture to test.
    test: PathBuf,
    /// Exit with 1 if the mean FLIP is above this, 0 to 1.
    #[arg(long, value_name = "X")]
    max_flip: Option<f64>,
    /// Write a picture of the differences.
    #[arg(long, value_name = "D.png")]
    diff: Option<PathBuf>,
    /// Print machine-readable results.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let (comparison, map) = compare::compare_files(&args.reference, &args.test)?;
    if let Some(path) = &args.diff {
        output::write_png(path, &map.picture())?;
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&comparison)?);
    } else {
        let c = &comparison;
        println!("mean FLIP {:.4}, 99th percentile {:.4}", c.mean_flip, c.p99_flip);
        match c.psnr_db {
            Some(psnr) => println!("RMSE {:.4}, PSNR {psnr:.2} dB", c.rmse),
            None => println!("identical"),
        }
        let w = &c.worst;
        println!(
            "worst pixel ({}, {}): FLIP {:.3}, {:?} in the reference, {:?} in the test",
            w.x, w.y, w.flip, w.reference, w.test
        );
    }
    let differs = args.max_flip.is_some_and(|max| comparison.mean_flip > max);
    Ok(ExitCode::from(u8::from(differs)))
}
