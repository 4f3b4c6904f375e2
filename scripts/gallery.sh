#!/usr/bin/env bash
# Draws the pictures of docs/gallery.md by the commands in it, with the program `limpid`, or $LIMPID.
# Needs a Python with numpy, ase, meshio and vtk: `python3`, or $PYTHON.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

program=${LIMPID:-limpid}
limpid() { "$program" "$@"; }

"${PYTHON:-python3}" tests/strangers/make.py target/strangers >/dev/null
while read -r command; do
    echo "$command"
    [[ $command == *' -o '* ]] && command="${command/ -o / -o docs/pictures/gallery/} --size 400x300 --samples 4"
    eval "$command --quiet"
done < <(grep '^limpid' docs/gallery.md)
rm -r docs/pictures/gallery/whitewater
