#!/usr/bin/env python3
"""Reads limpid's OpenEXR files with OpenEXR's own library: one part, named layers, plausible values.

    pip install OpenEXR numpy
    limpid render sims/demo.toml -o demo.exr --alpha --aov depth,normal,motion,coverage,mask
    tests/strangers/exr.py demo.exr demo.aov.exr
"""

import sys

import numpy
import OpenEXR

picture, images = sys.argv[1:3]


def channels(path):
    with OpenEXR.File(path, separate_channels=True) as file:
        assert len(file.parts) == 1, f"{path}: {len(file.parts)} parts"
        return {name: channel.pixels for name, channel in file.channels().items()}


colors, layers = channels(picture), channels(images)
assert set(colors) == {"R", "G", "B", "A"}, sorted(colors)
wanted = {"depth.Z", "normal.X", "normal.Y", "normal.Z", "motion.X", "motion.Y", "coverage.A", "mask.fluid1"}
assert wanted <= set(layers), sorted(layers)
depth, coverage = layers["depth.Z"], layers["coverage.A"]
normal = numpy.stack([layers[f"normal.{axis}"] for axis in "XYZ"])
shown = depth > 0
assert shown.any() and not shown.all(), "liquid is somewhere, and not everywhere"
assert numpy.allclose(numpy.linalg.norm(normal, axis=0)[shown], 1, atol=1e-5), "normals have length 1"
assert (normal[2][shown] > -0.5).all(), "surfaces face the eye, which off the axis is not along z"
assert ((coverage > 0) | ~shown).all(), "what is seen is covered"
assert (layers["mask.fluid1"] == coverage).all(), "the only fluid is the whole liquid"
assert all(numpy.isfinite(values).all() for values in [*colors.values(), *layers.values()])
print(f"{picture}, {images}: {', '.join(sorted(layers))}; liquid in {shown.mean():.1%} of the pixels")
