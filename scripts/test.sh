#!/usr/bin/env bash
# Runs the tests; on a fresh Debian or Ubuntu with Rust it installs what they need first.
#
#     scripts/test.sh [--all] [ARGUMENTS OF cargo test ...]
#
# `--all` includes the ignored tests, which are slow and which CI runs.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

arguments=()
if [[ ${1-} == --all ]]; then
    shift
    arguments=(-- --include-ignored)
    if [[ " $* " == *" -- "* ]]; then
        arguments=(--include-ignored)
    fi
fi

scripts/setup.sh
# Without a graphics adapter, a test that needs one would otherwise say so and pass.
export LIMPID_REQUIRE_GPU=1
cargo test --locked "$@" "${arguments[@]}"
