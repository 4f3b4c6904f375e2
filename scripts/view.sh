#!/usr/bin/env bash
# From a fresh clone to a playing liquid: installs what is missing, builds the window, and shows it, with demos on
# its first screen. Arguments are those of `limpid view`.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

"$root/scripts/setup.sh"
# Built there, run here: paths in the arguments are meant from where this was called.
cargo build --release --locked --features viewer --manifest-path "$root/Cargo.toml"
target=${CARGO_TARGET_DIR:-$root/target}
exec "$target/release/limpid" view "$@"
