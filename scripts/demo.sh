#!/usr/bin/env bash
# Renders a lagoon in the sun to demo.png, and one frame of a real sequence in a look to frame.png; on a
# fresh Debian or Ubuntu with Rust it installs what that needs first.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

scripts/setup.sh
cargo build --release --locked
limpid() { cargo run --release --locked --quiet -- "$@"; }

limpid render sims/lagoon.toml -o demo.png
limpid render 'tests/data/double_dam_break/ParticleData_Fluid_{}.bgeo' --frames 22 --radius 0.025 --look daylight --samples 4 \
    --camera 'eye=1.9,1.5,4.2 target=0,0.1,0 fov_y=36' -o frame.png
echo "wrote demo.png and frame.png"
