"""Draws the data sets of strangers as they would, with no option, and measures the pictures.

    pip install numpy OpenEXR
    python make.py FOLDER
    python check.py FOLDER [LIMPID]

Prints a table in Markdown, and fails if a set misses: the liquid fills 25 to 70 % of the picture's width, none of it
touches the border, the radius is within 5 % of the truth, nothing but the input and the output is remarked, and a
particle file with z up is drawn upright. The pictures lie beside the files.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import OpenEXR

WIDTH = (0.25, 0.70)
RADIUS = 0.05
TURNED = {"z_up.vtk"}


def liquid(path):
    """Where a picture shows liquid: the front layer of either class has a depth."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: c.pixels for part in file.parts for name, c in part.channels.items()}
    fronts = [pixels for name, pixels in channels.items() if "front" in name]
    assert fronts, sorted(channels)
    return np.any([front > 0 for front in fronts], axis=0)


def measured(limpid, file, truth):
    picture = file.with_name(file.name + ".png")
    command = [limpid, "render", file, "-o", picture]
    run = subprocess.run([*command, "--aov", "depth"], capture_output=True, text=True)
    if run.returncode != 0:
        return None, None, [run.stderr.strip() or f"exit code {run.returncode}"]
    info = json.loads(subprocess.run([limpid, "info", "--json", file], capture_output=True, check=True).stdout)
    seen = liquid(picture.with_suffix(".aov.exr"))
    columns = np.flatnonzero(seen.any(axis=0))
    width = (columns[-1] - columns[0] + 1) / seen.shape[1] if len(columns) else 0.0
    error = info["described"][0]["radius"] / truth["radius"] - 1
    misses = []
    if not WIDTH[0] <= width <= WIDTH[1]:
        misses.append("width")
    if any(edge.any() for edge in (seen[0], seen[-1], seen[:, 0], seen[:, -1])):
        misses.append("cut")
    if abs(error) > RADIUS:
        misses.append("radius")
    if info["turned"] != (file.name in TURNED):
        misses.append("up")
    # One line for the input and one for the output; a particle that is truly lost is remarked too.
    lines = [line for line in run.stderr.splitlines() if line]
    expected = 3 if truth.get("lost") else 2
    if len(lines) != expected or not lines[-1].startswith("limpid: wrote "):
        misses += lines[1:-1] or ["no remark"]
    return width, error, misses


def main(folder, limpid):
    truth = json.loads((folder / "truth.json").read_text())
    print("| file | by | what it is | particles | width | radius | misses |\n|---|---|---|---|---|---|---|")
    missed = 0
    for name, about in truth.items():
        width, error, misses = measured(limpid, folder / name, about)
        missed += bool(misses)
        shown = ["", ""] if width is None else [f"{100 * width:.0f} %", f"{100 * error:+.1f} %"]
        cells = [f"`{name}`", about["by"], about["says"], f"{about['particles']:,}", *shown, "; ".join(misses)]
        print("| " + " | ".join(cells) + " |", flush=True)
    if missed or len(truth) < 10:
        sys.exit(f"{missed} of {len(truth)} sets miss; 10 sets expected")


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: check.py FOLDER [LIMPID]")
    main(Path(sys.argv[1]), sys.argv[2] if len(sys.argv) > 2 else "limpid")
