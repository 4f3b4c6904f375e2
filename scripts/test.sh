#!/usr/bin/env bash
# Runs the tests; on a fresh Debian or Ubuntu with Rust it installs what they need first.
#
#     scripts/test.sh [--all | --rare] [ARGUMENTS OF cargo test ...]
#
# `--all` includes the ignored tests, which are slow and which CI runs; `--rare` runs those ignored ones alone that are
# in a module `rare`, and that `--all` leaves to `scripts/nightly.sh`.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

arguments=()
case ${1-} in
    --all) arguments=(--include-ignored --skip rare::) ;;
    --rare) arguments=(--ignored rare::) ;;
esac
if ((${#arguments[@]})); then
    shift
    [[ " $* " == *" -- "* ]] || arguments=(-- "${arguments[@]}")
fi

scripts/setup.sh
# Without a graphics adapter, a test that needs one would otherwise say so and pass.
export LIMPID_REQUIRE_GPU=1
cargo test --locked "$@" ${arguments[@]+"${arguments[@]}"}
