//! Standard input and standard output in place of files: `-`.

use std::io::{self, IsTerminal as _, Read, Write as _};
use std::path::{Path, PathBuf};

use limpid_io::Error;
use limpid_io::files;
use limpid_io::input::Input;
use limpid_io::open::{Opened, Request};
use limpid_io::particles::ReadOptions;

/// The argument that stands for standard input or output.
pub(crate) const DASH: &str = "-";

/// The name of standard input in messages.
const NAME: &str = "standard input";

/// Opens the input of a request, which may be standard input.
pub(crate) fn open(request: &Request) -> limpid_io::Result<Opened> {
    match request.input.as_deref() {
        Some(DASH) => request.open_from(input(&request.options)?),
        _ => request.open(),
    }
}

/// The particles of standard input.
pub(crate) fn input(options: &ReadOptions) -> limpid_io::Result<Input> {
    let (path, bytes) = read(options)?;
    Ok(Input::from_memory(&path, NAME, bytes))
}

/// Reads standard input; returns also a path with the extension of its format.
pub(crate) fn read(options: &ReadOptions) -> limpid_io::Result<(PathBuf, Vec<u8>)> {
    if io::stdin().is_terminal() {
        let problem = "-: standard input is a terminal; give it a file: limpid … - < particles.npz";
        return Err(Error::Usage(problem.into()));
    }
    let limit = options.max_unpacked.unwrap_or_else(|| files::unpacked_limit(u64::MAX));
    let bytes = read_to_end(io::stdin().lock(), limit)?;
    let extension = match bytes.as_slice() {
        [b'P', b'K', ..] => "npz",
        [b'p', b'l', b'y', b'\n' | b'\r', ..] => "ply",
        [] => return Err(Error::format(Path::new(NAME), "it is empty")),
        _ => {
            let problem =
                "expected .npz or PLY; write other formats to a file, whose name tells them";
            return Err(Error::format(Path::new(NAME), problem));
        }
    };
    Ok((format!("stdin.{extension}").into(), bytes))
}

/// Reads at most `limit` bytes.
fn read_to_end(input: impl Read, limit: u64) -> limpid_io::Result<Vec<u8>> {
    let path = Path::new(NAME);
    let mut bytes = Vec::new();
    let read = input.take(limit.saturating_add(1)).read_to_end(&mut bytes);
    read.map_err(|source| Error::Io { path: path.into(), action: "read", source })?;
    if bytes.len() as u64 > limit {
        let location = limpid_io::error::Location::Byte(limit);
        return Err(Error::TooLarge { path: path.into(), location, what: "file", limit });
    }
    Ok(bytes)
}

/// Fails if standard output is a terminal, which cannot show a picture.
pub(crate) fn check_output() -> limpid_io::Result<()> {
    if io::stdout().is_terminal() {
        let problem = "-: standard output is a terminal; redirect it: limpid … -o - > picture.png";
        return Err(Error::Usage(problem.into()));
    }
    Ok(())
}

/// Writes a file to standard output.
pub(crate) fn write(bytes: &[u8]) -> limpid_io::Result<()> {
    let mut stdout = io::stdout().lock();
    let written = stdout.write_all(bytes).and_then(|()| stdout.flush());
    written.map_err(|source| Error::Io { path: "standard output".into(), action: "write", source })
}
