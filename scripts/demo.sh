#!/usr/bin/env bash
# Renders the built-in demo to demo.png and one frame of a real sequence to frame.png; on a fresh
# Debian or Ubuntu with Rust it installs what that needs first.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scripts/setup.sh
cargo build --release --locked
limpid() { cargo run --release --locked --quiet -- "$@"; }

limpid render -o demo.png
limpid render 'tests/data/double_dam_break/ParticleData_Fluid_{}.bgeo' \
    --frames 20 --radius 0.025 --samples 4 -o frame.png
echo "wrote demo.png and frame.png"
