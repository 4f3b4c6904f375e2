#!/usr/bin/env bash
# Checks that `.ci/run` leaves out: they take long, install much, or find what a day's change hardly breaks. Each
# step is run whatever became of the others, and told at the end; the exit code is 1 if one has failed.
#
#     scripts/nightly.sh [STEP ...]     all steps, or these
#
# LIMPID_SEED is where the mutants of hostile files begin: by default the day, so that each night has others.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source scripts/steps.sh

export LIMPID_SEED=${LIMPID_SEED:-$(($(date +%s) / 86400 * 100000))}
wanted=" $* "
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
report=()
failed=0

# Runs the function of this name as a step.
step() {
    local begun=$SECONDS status outcome=passed
    [[ $wanted == "  " || $wanted == *" $1 "* ]] || return 0
    printf '\n== %s: %s\n' "$1" "$2"
    # Not within a condition, where bash passes over what fails.
    (
        set -e
        "$1"
    )
    status=$?
    if ((status)); then
        outcome="FAILED ($status)"
        failed=1
    fi
    report+=("$(printf '%6d s  %-12s %s: %s' "$((SECONDS - begun))" "$outcome" "$1" "$2")")
}

# Findings of the mutants of one format and seed are the same on every machine.
hostile() {
    echo "LIMPID_SEED=$LIMPID_SEED"
    LIMPID_HOSTILE_ROUNDS=20000 cargo test --release --locked -p limpid-cli --test hostile changed_fields
    LIMPID_HOSTILE_ROUNDS=20000 cargo test --release --locked -p limpid-cli --test hostile mutated
}

hdf5() {
    has_python_index || return 0
    python3 -m venv "$CARGO_TARGET_DIR/h5py"
    "$CARGO_TARGET_DIR/h5py/bin/python" -m pip install --quiet --disable-pip-version-check numpy h5py
    LIMPID_HOSTILE_HDF5=$work/hdf5 LIMPID_HOSTILE_ROUNDS=3000 \
        cargo test --release --locked -p limpid-cli --test hostile changed_fields
    cargo build --release --locked
    "$CARGO_TARGET_DIR/h5py/bin/python" crates/limpid-cli/tests/hostile/hdf5.py "$work/hdf5" \
        "$CARGO_TARGET_DIR/release/limpid" 3000
}

rare() { scripts/test.sh --rare "${features[@]}"; }

golden() {
    cargo run --release --locked --quiet -- check tests/golden/limpid.toml --out "$CARGO_TARGET_DIR/golden"
}

opengl() { in_opengl refract fluids intersectors shader_math classify_device bins; }

# Code that is compiled only without the window.
lints() {
    cargo clippy --locked -p limpid-cli -- -D warnings
    cargo test --locked -p limpid-cli --test cli without_the_viewer
}

advisories() {
    if ! git ls-remote --exit-code https://github.com/RustSec/advisory-db HEAD >/dev/null 2>&1; then
        echo "the list of advisories cannot be reached: not checked"
        return
    fi
    deny advisories
}

# An engine is 450 crates.
bevy() {
    local manifest=crates/limpid-io/examples/bevy/Cargo.toml
    fetches "$manifest" || return 0
    cargo check --locked --ignore-rust-version --manifest-path "$manifest"
}

# As they would be published; in a folder of their own, since cargo assumes that published packages never change.
packages() {
    local built=$CARGO_TARGET_DIR/packages
    rm -rf "$built"
    CARGO_TARGET_DIR=$built cargo publish --dry-run --locked --workspace --exclude limpid-python --exclude limpid-web
    rm -rf "$built"
}

site() {
    has_python_index || return 0
    scripts/site.sh
}

page() {
    has_browser || return 0
    scripts/web.sh
    LIMPID_WEB_BUILT=1 scripts/web-test.sh
}

python() {
    has_python_index || return 0
    scripts/python.sh --all
}

printf '\n== setup\n'
setup
step rare "tests that a day's change hardly breaks"
step hostile "20,000 mutants of each format"
step hdf5 "mutants of HDF5, and files of h5py, compared with what h5py reads"
step golden "golden frames, as the program is shipped"
step opengl "the other tests in OpenGL"
step lints "the program without its window"
step advisories "known flaws of what limpid depends on"
step bevy "the example in Bevy"
step packages "crates, as they would be published"
step site "the pages as a site, and links between them"
step page "the page as it is shipped, all tests in a browser"
step python "fuzzing and memory, PyVista, the notebook and Blender"

printf '\n== nightly\n'
printf '%s\n' "${report[@]}"
exit "$failed"
