//! Standard input and standard output in place of files: `-`.

use std::io::{self, IsTerminal as _, Read, Write as _};
use std::path::{Path, PathBuf};

use limpid_io::Error;
use limpid_io::error::{Location, Unpacked};
use limpid_io::files;
use limpid_io::input::Input;
use limpid_io::open::{Opened, Request};
use limpid_io::particles::ReadOptions;

/// The argument that stands for standard input or output.
const DASH: &str = "-";

/// Whether an argument stands for standard input or output.
pub(crate) fn is_dash(path: &Path) -> bool {
    path == Path::new(DASH)
}

/// The name of standard input in messages.
const NAME: &str = "standard input";

/// Opens the input of a request, which may be standard input.
pub(crate) fn open(request: &Request) -> limpid_io::Result<Opened> {
    match request.input.as_deref() {
        Some(path) if is_dash(path) => request.open_from(input(&request.options)?),
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
    // Its length is not known, and it may have no end.
    let limit = options.max_unpacked.unwrap_or_else(|| files::unpacked_limit(0));
    let (extension, bytes) = read_within(io::stdin().lock(), limit)?;
    Ok((format!("stdin.{extension}").into(), bytes))
}

/// Reads at most `limit` bytes of a format that the first bytes tell; returns also its extension.
fn read_within(mut input: impl Read, limit: u64) -> limpid_io::Result<(&'static str, Vec<u8>)> {
    const MAGIC: u64 = 4;
    let path = Path::new(NAME);
    let mut bytes = Vec::new();
    let mut read = |count: u64, bytes: &mut Vec<u8>| {
        let read = input.by_ref().take(count).read_to_end(bytes);
        read.map_err(|source| Error::Io { path: path.into(), action: "read", source })
    };
    read(MAGIC, &mut bytes)?;
    let extension = match bytes.as_slice() {
        [b'P', b'K', ..] => "npz",
        [b'p', b'l', b'y', b'\n' | b'\r', ..] => "ply",
        [] => return Err(Error::format(path, "it is empty")),
        _ => {
            let problem =
                "expected .npz or PLY; write other formats to a file, whose name tells them";
            return Err(Error::format(path, problem));
        }
    };
    read(limit.saturating_add(1).saturating_sub(MAGIC), &mut bytes)?;
    if bytes.len() as u64 > limit {
        let (path, location) = (path.into(), Location::Byte(limit));
        return Err(Error::TooLarge { path, location, what: Unpacked::File, limit });
    }
    Ok((extension, bytes))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// An input without end is refused by its first bytes, or at the limit.
    #[test]
    fn endless_input_is_not_read() {
        let mut zeros = io::repeat(0).take(5);
        assert!(matches!(read_within(&mut zeros, 1 << 40), Err(Error::Format { .. })));
        assert_eq!(zeros.limit(), 1, "no more than the first bytes are read");
        let mut endless = b"ply\n".chain(io::repeat(b'x')).take(1000);
        let error = read_within(&mut endless, 100).unwrap_err();
        assert!(matches!(error, Error::TooLarge { limit: 100, .. }), "{error}");
        assert_eq!(endless.limit(), 1000 - 101);
        let (extension, bytes) = read_within(&b"PK\x03\x04rest"[..], 8).expect("an archive");
        assert_eq!((extension, bytes.len()), ("npz", 8));
    }
}
