//! The command `limpid compare`.

use std::path::PathBuf;

use limpid_io::output;
use limpid_io::output::{FileKind, Files, PictureFormat};
use limpid_lab::compare;

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
        files.writes(path, FileKind::PICTURE)?;
        if PictureFormat::of(path)? == PictureFormat::Exr {
            let problem = "differences are an 8-bit picture: expected .png, .jpg or .webp";
            return Err(limpid_io::Error::Usage(format!("{}: {problem}", path.display())).into());
        }
    }
    let (comparison, map) = compare::compare_files(&args.reference, &args.test)?;
    if let Some(path) = &args.diff {
        output::write_picture(path, &map.picture().into(), &[])?;
    }
    let text =
        if args.json { serde_json::to_string_pretty(&comparison)? } else { describe(&comparison) };
    crate::terminal::print(&text)?;
    let differs = args.max_flip.is_some_and(|max| comparison.mean_flip > max);
    Ok(u8::from(differs))
}

fn describe(c: &compare::Comparison) -> String {
    let distance = match c.psnr_db {
        Some(psnr) => format!("RMSE {:.4}, PSNR {psnr:.2} dB", c.rmse),
        None => "identical".to_owned(),
    };
    let w = &c.worst;
    format!(
        "mean FLIP {:.4}, 99th percentile {:.4}\n{distance}\nworst pixel ({}, {}): FLIP {:.3}, {:?} in the reference, {:?} in the test",
        c.mean_flip, c.p99_flip, w.x, w.y, w.flip, w.reference, w.test
    )
}

fn parse_share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| "expected 0 to 1".to_owned())
}
