#!/usr/bin/env bash
# Builds the Python package and runs its tests: the wheel is built in one clean virtual environment and tested in
# another, which has NumPy and the test tools alone.
#
#   scripts/python.sh        the package and its types; FEATURES=viewer for a wheel with the window of `limpid view`
#   scripts/python.sh --all  of the wheel to publish, small and for glibc 2.28, which takes long to build; also fuzzing
#                            and memory, PyVista, the notebook and the Blender add-on, with what they need from the
#                            Python index
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

all=false
[[ ${1-} == --all ]] && all=true

export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/target}"
folder=$CARGO_TARGET_DIR/python
say() { echo "python: $*" >&2; }

scripts/setup.sh

python=$(command -v python3 || true)
if [[ -z $python ]] || ! "$python" -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 10))' 2>/dev/null; then
    say "CPython 3.10 or newer with venv is needed (Debian: apt-get install python3-venv)"
    exit 1
fi

# A virtual environment of this name with these packages.
environment() {
    local name=$1
    shift
    [[ -x $folder/$name/bin/python ]] || "$python" -m venv "$folder/$name"
    "$folder/$name/bin/python" -m pip install --quiet --disable-pip-version-check --upgrade "$@"
}

say "building the wheel"
features=${FEATURES-}
options=(--release)
if $all; then
    options=(--profile wheel)
    # For systems with glibc 2.28 and newer, as the archives of scripts/release.sh: zig links with an old one.
    [[ $(uname) == Linux ]] && options+=(--zig --compatibility manylinux_2_28)
fi
[[ -z $features ]] || options+=(--features "$features")
tools=("maturin>=1.16,<2")
[[ ${options[*]} != *--zig* ]] || tools+=(ziglang)
environment build "${tools[@]}"
rm -rf "$folder/wheels"
scripts/packaging/licences.py limpid-python $features >python/LICENSE-THIRD-PARTY.txt
(cd python && PATH="$folder/build/bin:$PATH" "$folder/build/bin/maturin" build --locked --quiet \
    --out "$folder/wheels" "${options[@]}")
wheel=$(echo "$folder"/wheels/*.whl)
bytes=$(($(wc -c <"$wheel")))
say "$(basename "$wheel"): $((bytes / 1000)) kB"
if $all && ((bytes > 10000000)); then
    say "the wheel is larger than 10 MB"
    exit 1
fi

# Tests import the installed package, not the folder beside them.
check() {
    local name=$1
    shift
    "$folder/$name/bin/python" -m pip install --quiet --disable-pip-version-check --force-reinstall --no-deps "$wheel"
    (cd python/tests && "$folder/$name/bin/python" -m pytest -q "$@")
}

say "the package with NumPy alone"
rm -rf "$folder/plain"
environment plain numpy pytest mypy
check plain --ignore blender

$all || exit 0

say "fuzzing, memory, PyVista"
environment full numpy pytest hypothesis pillow psutil pyvista matplotlib nbconvert ipykernel auditwheel twine \
    anywidget pandas polars OpenEXR "pyright[nodejs]"
"$folder/full/bin/twine" check --strict "$wheel"
LIMPID_REQUIRE_PYVISTA=1 check full test_fuzz.py test_memory.py test_vtk.py test_film.py \
    test_render.py test_arrays.py test_view.py test_examples.py
glibc=$("$folder/full/bin/auditwheel" show "$wheel" | tr '\n' ' ' | grep -o 'platform *tag: *"manylinux_[0-9]*_[0-9]*' | grep -o '[0-9]*$')
if ((glibc > 28)); then
    say "the wheel needs glibc 2.$glibc, newer than 2.28"
    exit 1
fi

say "the notebook"
# Its kernel is the `python` of the path.
(cd python/examples && PATH="$folder/full/bin:$PATH" "$folder/full/bin/python" -m jupyter nbconvert \
    --log-level ERROR --to notebook --execute --output-dir "$folder" dam.ipynb)

say "Blender"
# Its module is for one version of CPython, and large.
if environment blender "bpy>=4.2" pytest pillow 2>/dev/null; then
    LIMPID_REQUIRE_BPY=1 check blender blender
    "$folder/blender/bin/python" python/blender/package.py "$wheel" -o "$folder/extensions" >&2
else
    say "the module bpy cannot be installed here: not tested"
fi
