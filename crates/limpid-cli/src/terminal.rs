//! Lines for the user: messages on standard error, results on standard output, and progress.

use std::io::{self, ErrorKind, Write as _};

use indicatif::{ProgressBar, ProgressStyle};

/// A line without commands to the terminal: names of files may hold anything.
fn plain(line: &str) -> String {
    line.replace(char::is_control, "?")
}

/// Says on standard error what is wrong, on one line.
pub(crate) fn complain(problem: impl std::fmt::Display) {
    let words: Vec<String> = problem.to_string().split(' ').map(brief).collect();
    tell(&format!("limpid: {}", words.join(" ")));
}

/// A word without its middle, if that is so long that nobody would find the rest of the line: an
/// argument that should not be one is said back in full. A path may have 4096 characters; its ends tell.
fn brief(word: &str) -> String {
    const MOST: usize = 512;
    const END: usize = 128;
    let count = word.chars().count();
    if count <= MOST {
        return word.to_owned();
    }
    let start = word.chars().take(MOST - END);
    start.chain("...".chars()).chain(word.chars().skip(count - END)).collect()
}

/// Writes one line to standard error. Messages may be lost (a full disk, a reader that has left), work
/// may not: so this neither fails nor panics, as `eprintln!` does.
pub(crate) fn tell(line: &str) {
    let line = plain(line) + "\n";
    let _ = io::stderr().write_all(line.as_bytes());
}

/// Prints results; a reader that has seen enough (`| head -1`) is not an error.
pub(crate) fn print(text: &str) -> limpid_io::Result<()> {
    let lines: Vec<String> = text.split('\n').map(plain).collect();
    let text = lines.join("\n") + "\n";
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => {
            Err(limpid_io::Error::Io { path: "standard output".into(), action: "write", source })
        }
        _ => Ok(()),
    }
}

/// Hidden unless standard error is a terminal.
pub(crate) fn progress(frames: usize) -> ProgressBar {
    let bar = if frames > 1 { ProgressBar::new(frames as u64) } else { ProgressBar::hidden() };
    let template = "{bar:40} {pos}/{len} frames, {per_sec}, {eta} left";
    bar.with_style(ProgressStyle::with_template(template).expect("the template is valid"))
}
