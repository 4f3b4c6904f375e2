#!/usr/bin/env bash
# Builds the Python package and runs its tests: the wheel is built in one clean virtual environment and tested in
# another, which has NumPy and the test tools alone.
#
#   scripts/python.sh        the package and its types
#   scripts/python.sh --all  also fuzzing and memory, PyVista, the notebook and the Blender add-on, with what they need
#                            from the Python index
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
environment build "maturin>=1.16,<2"
rm -rf "$folder/wheels"
(cd python && "$folder/build/bin/maturin" build --release --locked --out "$folder/wheels" --quiet)
wheel=$(echo "$folder"/wheels/*.whl)
say "$(basename "$wheel"): $(du -k "$wheel" | cut -f 1) KiB"

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
environment full numpy pytest hypothesis pillow psutil pyvista matplotlib nbconvert ipykernel auditwheel twine
"$folder/full/bin/twine" check --strict "$wheel"
LIMPID_REQUIRE_PYVISTA=1 check full test_fuzz.py test_memory.py test_vtk.py test_film.py test_render.py
"$folder/full/bin/auditwheel" show "$wheel" | grep -o 'manylinux_[0-9_a-z]*' | sort -u | head -n 1

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
