#!/usr/bin/env bash
# Compares the interfaces of the libraries with those of a revision or a tag, by cargo-semver-checks.
#
#     scripts/semver.sh v0.1.0            all libraries
#     scripts/semver.sh HEAD~20 limpid    some
#
# It fails, and lists what is incompatible, if the version in Cargo.toml promises more than the interfaces keep: before 1.0
# a new minor version may change them, a patch may not. Installs the tool if it is missing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

if [[ $# == 0 ]]; then
    echo "semver: expected a revision, and perhaps libraries: scripts/semver.sh HEAD~20 limpid" >&2
    exit 2
fi
baseline=$1
shift
libraries=("$@")
[[ $# -gt 0 ]] || libraries=(limpid limpid-sim limpid-io limpid-lab limpid-viewer)

version=0.51.0
tools=${CARGO_TARGET_DIR:-$PWD/target}/tools
export PATH=$tools/bin:$PATH
if [[ $(cargo semver-checks --version 2>/dev/null) != "cargo-semver-checks $version" ]]; then
    cargo install --locked --root "$tools" --target-dir "$tools/build" "cargo-semver-checks@$version"
    rm -r "$tools/build"
fi
cargo semver-checks --baseline-rev "$baseline" "${libraries[@]/#/--package=}"
