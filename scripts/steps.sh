# Sourced by .ci/run and scripts/nightly.sh: one target folder outside the checkout, so that a fresh one does not build
# every dependency again, and what both need to know of the machine.

export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-${XDG_CACHE_HOME:-$HOME/.cache}/limpid-ci-target}"

# Tests contain the path of their checkout, which cargo does not compare: those of another are built again.
if [[ $(cat "$CARGO_TARGET_DIR/checkout" 2>/dev/null) != "$PWD" ]]; then
    find . -name '*.rs' -not -path './target/*' -exec touch {} +
    mkdir -p "$CARGO_TARGET_DIR"
    printf '%s\n' "$PWD" >"$CARGO_TARGET_DIR/checkout"
fi

# Pictures that other software made: beside the checkout, where this project is worked on.
references=$PWD/../shared/reference
if [[ -d $references ]]; then
    export LIMPID_REFERENCE=$references LIMPID_REQUIRE_REFERENCE=1
fi

# Installs all that tests need. Where a machine cannot, they say so and pass; where it can, they must run.
setup() {
    if scripts/setup.sh --all; then
        export LIMPID_REQUIRE_WINDOW=1 LIMPID_REQUIRE_FFMPEG=1 LIMPID_REQUIRE_SLURM=1
        export LIMPID_REQUIRE_FAKETIME=1
    fi
}

# Whether the crates of another workspace can be fetched. Its lock file must fit: a stale one ends the run.
fetches() {
    local message
    if message=$(cargo fetch --locked --quiet --manifest-path "$1" 2>&1); then
        return
    fi
    printf '%s\n' "$message" >&2
    if [[ $message == *'lock file'* ]]; then
        echo "$1: run cargo update --workspace there" >&2
        exit 1
    fi
    echo "its crates cannot be fetched: not checked"
    return 1
}

# Checks what limpid depends on. cargo-deny, which takes minutes to build, stays in the target folder.
deny() {
    PATH=$PATH:$CARGO_TARGET_DIR/tools/bin
    command -v cargo-deny >/dev/null || cargo install --locked --quiet --root "$CARGO_TARGET_DIR/tools" cargo-deny
    cargo deny --workspace check "$@"
}

# One set of features for all that CI builds: other sets build the same crates again.
features=(--features limpid-cli/viewer-tests)

# Modules of tests that read and write textures, in Mesa's OpenGL beside its Vulkan, where the machine has both.
in_opengl() {
    if ! ldconfig -p | grep 'libEGL\.so' >/dev/null; then
        echo "no OpenGL here: not tested"
        return
    fi
    local programs=(--test renderer --test source --test lab --test io) module
    # A name that no module has would pass.
    for module; do
        cargo test --quiet --locked "${features[@]}" "${programs[@]}" -- --list "$module::" | grep ': test$' >/dev/null || {
            echo "no tests in a module $module" >&2
            return 1
        }
    done
    WGPU_BACKEND=gl LIMPID_REQUIRE_GPU=1 cargo test --locked "${features[@]}" "${programs[@]}" -- "${@/%/::}"
}

# Whether a browser for the tests of the page is there, or can be installed, with what drives it.
has_browser() {
    if command -v npm >/dev/null && { [[ -x /usr/bin/chromium ]] || apt-cache policy chromium 2>/dev/null | grep 'Candidate: [0-9]' >/dev/null; }; then
        return
    fi
    echo "Chromium or npm cannot be installed: not tested"
    return 1
}

# Whether Python packages can be installed.
has_python_index() {
    local folder
    folder=$(mktemp -d)
    if python3 -m pip download --quiet --disable-pip-version-check --no-deps --dest "$folder" maturin; then
        rm -r "$folder"
        return
    fi
    rm -r "$folder"
    echo "the Python index cannot be reached: not tested"
    return 1
}
