//! The command `limpid convert`.

use std::path::{Path, PathBuf};

use limpid::liquid::{Particles, Up};
use limpid_io::frames::FrameSpec;
use limpid_io::input::{self, Input};
use limpid_io::notice::{self, Notice};

use crate::{remedy, standard, terminal};
use limpid_io::output::{self, Files, OutputNames};
use limpid_io::particles::{self, Contents, Remark};
use limpid_io::sequence::{Frame, Sequence};
use rayon::prelude::*;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// A particle file, a pattern such as frame_{}.vtk, or a folder; - reads .npz or PLY from standard input.
    input: PathBuf,
    /// Output file, whose extension selects the format; for several frames a name with a placeholder
    /// for the number (####, {}, %04d, $F4), or a folder for `frame_####.bgeo`.
    #[arg(required_unless_present = "named")]
    output: Option<PathBuf>,
    /// The output, as other commands name it.
    #[arg(short = 'o', long = "output", value_name = "OUTPUT", conflicts_with = "output")]
    named: Option<PathBuf>,
    /// Frames: 1-3,5, 7-20:2, all [default: all].
    #[arg(long, allow_hyphen_values = true)]
    frames: Option<FrameSpec>,
    /// The axis that points up in the input, y or z; the output has y up [default: as the format or the
    /// particles tell].
    #[arg(long, value_parser = crate::shared_args::parse_up)]
    up: Option<Up>,
    #[command(flatten)]
    reading: crate::shared_args::Reading,
    /// Skip frames whose file exists.
    #[arg(long)]
    skip_existing: bool,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<u8> {
    let options = args.reading.options();
    let (sequence, piped) = match standard::is_dash(&args.input) {
        true => {
            let (path, bytes) = standard::read(&options)?;
            let frames = vec![Frame::new(0, path)];
            let sequence = Sequence { frames, pattern: "-".into(), fps: None, absent: Vec::new() };
            (sequence, Some(bytes))
        }
        false => (Sequence::open(&args.input)?, None),
    };
    let frames = args.frames.clone().unwrap_or_default().select(&sequence)?;
    let output = args.output.as_ref().or(args.named.as_ref()).expect("one of them is required");
    let slash = output.as_os_str().as_encoded_bytes().ends_with(b"/");
    let is_folder = slash || output.is_dir();
    let pattern = if is_folder { output.join("frame_####.bgeo") } else { output.clone() };
    let frame_count = frames.len();
    let names = OutputNames::parse(&pattern, frame_count)?;
    // Fails for an unknown format before anything is read.
    particles::unsupported_attributes(&Particles::default(), &pattern)?;
    if is_folder {
        output::check_folder(output)?;
        let error = |e| limpid_io::Error::Io { path: output.clone(), action: "create", source: e };
        std::fs::create_dir_all(output).map_err(error)?;
    }
    let skip = |frame: &&Frame| args.skip_existing && names.path(frame.number).exists();
    let todo: Vec<&Frame> = frames.into_iter().filter(|frame| !skip(frame)).collect();
    let mut files = Files::default();
    input::files_of(&args.input).iter().for_each(|path| files.reads(path));
    for frame in &todo {
        let path = names.path(frame.number);
        files.writes(&path, particles::FILE_KIND)?;
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("pos")) {
            files.writes(&path.with_extension("ani"), particles::ELLIPSOIDS_KIND)?;
        }
    }

    let up = match (args.up, &piped) {
        (Some(up), _) => up,
        (None, _) if todo.is_empty() => Up::Y,
        (None, Some(bytes)) => likely_up(
            Input::from_memory(&sequence.frames[0].path, &sequence.pattern, bytes.clone()),
            args,
        ),
        (None, None) => likely_up(Input::open(&args.input)?, args),
    };
    let gaps = sequence.gaps();
    if args.frames.is_none() && !gaps.is_empty() {
        terminal::remark(remedy::of_notice(&Notice::Gaps(gaps, None)));
    }
    let steps = args.frames.as_ref();
    let steps = steps.and_then(|spec| notice::of_selection(spec, &sequence, frame_count));
    steps.iter().for_each(|notice| terminal::remark(remedy::of_notice(notice)));
    let bar = terminal::progress(todo.len());
    let (mut lost, mut ignored, mut remarks) = (Vec::new(), Vec::new(), Vec::new());
    // In chunks, since work stealing would otherwise hold more frames in memory than there are threads.
    for frames in todo.chunks(rayon::current_num_threads()) {
        let convert = |frame: &&Frame| {
            let contents = match &piped {
                Some(bytes) => Contents::parse(&frame.path, bytes, &options),
                None => frame.read(&options),
            };
            let path = names.path(frame.number);
            let converted = contents.and_then(|mut contents| {
                let remarks = std::mem::take(&mut contents.remarks);
                write(contents, &path, up).map(|names| (names, remarks))
            });
            bar.inc(1);
            converted
        };
        let converted: Vec<_> = frames.par_iter().map(convert).collect();
        for names in converted {
            // Clears the bar, which must not share a line with the error.
            let ((names, arrays), read) = names.inspect_err(|_| bar.finish_and_clear())?;
            for remark in read {
                if !remarks.iter().any(|told: &Remark| told.subject() == remark.subject()) {
                    remarks.push(remark);
                }
            }
            add_missing(&mut lost, names);
            add_missing(&mut ignored, arrays);
        }
    }
    bar.finish_and_clear();
    remarks.iter().for_each(|remark| terminal::remark(remedy::of_remark(remark)));
    if !lost.is_empty() {
        let (output, lost) = (pattern.display(), lost.join(", "));
        terminal::remark(format!("{output}: this format has no room for {lost}"));
    }
    if !ignored.is_empty() {
        let (arrays, verb) = (ignored.join(", "), if ignored.len() > 1 { "are" } else { "is" });
        let remedy = "--map reads attributes from arrays of other names";
        let input = args.input.display();
        terminal::remark(format!("{input}: {arrays} {verb} left out; {remedy}"));
    }
    Ok(crate::SUCCESS)
}

/// The axis that points up in an input, as for its pictures, and y if that cannot be found out; says so if it is not y.
fn likely_up(input: Input, args: &Args) -> Up {
    let resolved = input.with_options(&args.reading.options()).resolve();
    let (up, from) = resolved.map_or_else(|_| Default::default(), |(loader, _)| loader.up());
    if up != Up::Y {
        let (input, from) = (args.input.display(), from.word());
        terminal::remark(format!(
            "{input}: {up} points up ({from}), and the output is turned to y up; --up y leaves it"
        ));
    }
    up
}

/// Writes a frame; returns the attributes that the format cannot store, and the names of the ignored arrays.
fn write(
    contents: Contents,
    path: &Path,
    up: Up,
) -> limpid_io::Result<(Vec<&'static str>, Vec<String>)> {
    let Contents { mut particles, arrays, .. } = contents;
    particles.to_y_up(up);
    particles::write(&particles, path)?;
    let ignored = arrays.into_iter().filter(|array| array.used_as.is_none());
    Ok((
        particles::unsupported_attributes(&particles, path)?,
        ignored.map(|array| array.name).collect(),
    ))
}

/// Adds the names that are missing.
fn add_missing<T: PartialEq>(names: &mut Vec<T>, more: Vec<T>) {
    for name in more {
        if !names.contains(&name) {
            names.push(name);
        }
    }
}
