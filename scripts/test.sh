#!/usr/bin/env bash
# Runs all the tests; on a fresh Debian or Ubuntu with Rust it installs what they need first.
# Arguments go to `cargo test`.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scripts/setup.sh
# Without a graphics adapter, a test that needs one would otherwise say so and pass.
export LIMPID_REQUIRE_GPU=1
cargo test --locked "$@"
