//! Output to the user: messages on standard error, results on standard output, and progress.

use std::io::{self, ErrorKind, Write as _};
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressStyle};

/// Whether remarks and progress are not shown.
static SILENT: AtomicBool = AtomicBool::new(false);

/// From now on shows no remarks and no progress: `--quiet`.
pub(crate) fn silence() {
    SILENT.store(true, Ordering::Relaxed);
}

/// Whether remarks and progress are not shown.
pub(crate) fn is_silent() -> bool {
    SILENT.load(Ordering::Relaxed)
}

/// Removes terminal control characters from a line, since file names may contain them.
fn without_controls(line: &str) -> String {
    line.replace(char::is_control, "?")
}

/// Prints a message on standard error, on one line that begins with the program's name.
pub(crate) fn warn(problem: impl std::fmt::Display) {
    let words: Vec<String> = problem.to_string().split(' ').map(shortened).collect();
    print_line(&format!("limpid: {}", words.join(" ")));
}

/// Prints a message that is no error, unless [silent](silence).
pub(crate) fn remark(text: impl std::fmt::Display) {
    if !is_silent() {
        warn(text);
    }
}

/// Removes the middle of a very long word, such as a wrong argument quoted in full, which would make the
/// rest of the line hard to find. A path may have 4096 characters; its ends identify it.
fn shortened(word: &str) -> String {
    const MAX_LENGTH: usize = 512;
    const END: usize = 128;
    let count = word.chars().count();
    if count <= MAX_LENGTH {
        return word.to_owned();
    }
    let start = word.chars().take(MAX_LENGTH - END);
    start.chain("...".chars()).chain(word.chars().skip(count - END)).collect()
}

/// Writes one line to standard error. Unlike `eprintln!`, it does not panic: a message that cannot be
/// written (a full disk, a closed pipe) must not end the run.
pub(crate) fn print_line(line: &str) {
    let line = without_controls(line) + "\n";
    let _ = io::stderr().write_all(line.as_bytes());
}

/// Prints results on standard output; a closed pipe (`| head -1`) is not an error.
pub(crate) fn print(text: &str) -> limpid_io::Result<()> {
    let lines: Vec<String> = text.split('\n').map(without_controls).collect();
    let text = lines.join("\n") + "\n";
    let mut stdout = io::stdout().lock();
    match stdout.write_all(text.as_bytes()).and_then(|()| stdout.flush()) {
        Err(source) if source.kind() != ErrorKind::BrokenPipe => {
            Err(limpid_io::Error::Io { path: "standard output".into(), action: "write", source })
        }
        _ => Ok(()),
    }
}

/// Creates a progress bar, which is hidden for a single frame, where [silent](silence), and unless standard error
/// is a terminal.
pub(crate) fn progress(frames: usize) -> ProgressBar {
    let bar = if frames > 1 && !is_silent() {
        ProgressBar::new(frames as u64)
    } else {
        ProgressBar::hidden()
    };
    let template = "{bar:40} {pos}/{len} frames, {per_sec}, {eta} left";
    bar.with_style(ProgressStyle::with_template(template).expect("the template is valid"))
}
