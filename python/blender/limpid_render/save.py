"""A translated scene as files that the program `limpid` reads."""

import contextlib
import json
import math
import os
import re

import bpy
import limpid
import numpy as np

from . import particles, source
from .errors import Problem
from .surfaces import encoded
from .translate import scene_of


def save_scene(path, translation, depsgraph, report):
    """Writes a scene, its meshes into a folder beside it, and particles of an object."""
    settings = depsgraph.scene.limpid
    folder = os.path.splitext(path)[0] + "_meshes"
    used = set()
    solids = [_solid(shape, folder, used) for shape in translation.shapes]
    scene_of(translation, settings, solids).save(path)
    if settings.source == "OBJECT":
        file = os.path.splitext(path)[0] + "_particles.npz"
        limpid.write(file, source.liquid_of(depsgraph, report).particles)
        table = {"source": os.path.basename(file), "up": "y"}
    else:
        table = _particles(path, settings, depsgraph.scene.frame_current)
    if settings.radius > 0.0:
        table["radius"] = settings.radius
    if settings.attribute:
        report.add("saved scenes have the colour of the liquid", f"attribute {settings.attribute}")
    with open(path, "a", encoding="utf-8") as written:
        written.write(_table("camera", _camera(translation.camera)) + _table("particles", table))
    # Fails if the program could not read it.
    limpid.Scene.load(path)


def _solid(shape, folder, used):
    """A solid of limpid in a file of its own."""
    if not os.path.isdir(folder):
        os.mkdir(folder)
    plain = re.sub(r"[^\w.-]+", "_", shape.name) or "mesh"
    name, number = plain, 1
    while name in used:
        number += 1
        name = f"{plain}_{number}"
    used.add(name)
    file = os.path.join(folder, name + ".ply")
    look = {} if shape.color is None else {"color": tuple(shape.color)}
    if shape.picture is not None:
        look = {"texture": os.path.join(folder, name + ".png")}
        _write_picture(look["texture"], encoded(shape.picture))
    _write_ply(file, shape.vertices, shape.faces, shape.coordinates)
    return limpid.Mesh(file, normals="smooth" if shape.smooth else "flat", lit=shape.lit, **look)


def _write_ply(path, vertices, faces, coordinates):
    """A binary PLY file; texture coordinates, s and t, count from a picture's first row."""
    names = ["x", "y", "z"]
    rows = vertices
    if coordinates is not None:
        names += ["s", "t"]
        rows = np.hstack([vertices, coordinates])
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    header += [f"property double {name}" for name in names]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    corners = np.empty(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    corners["count"] = 3
    corners["corners"] = faces
    with open(path, "wb") as file:
        file.write("\n".join([*header, ""]).encode("ascii"))
        file.write(rows.astype("<f8").tobytes())
        file.write(corners.tobytes())


def _write_picture(path, pixels):
    """A PNG file of sRGB pixels, rows from the top."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("limpid", width, height)
    try:
        opaque = np.ones((height, width, 4), np.float32)
        opaque[..., :3] = pixels[::-1] / np.float32(255.0)
        image.pixels.foreach_set(opaque.ravel())
        image.file_format = "PNG"
        image.save(filepath=path)
    finally:
        bpy.data.images.remove(image)


def _camera(camera):
    """The camera as a table of a scene file, which aims it."""
    rotation = camera.view[:3, :3].T
    eye = -rotation @ camera.view[:3, 3]
    right, up, back = rotation.T
    (width, height), matrix = camera.size, camera.projection
    square = abs(matrix[0, 0] * width - matrix[1, 1] * height) < 1e-5 * matrix[1, 1] * height
    if matrix[3, 2] == 0.0:
        if not square:
            raise Problem("a scene file has no orthographic camera of pixels that are not square")
        # A shifted lens is a camera that has moved, as is one that sees behind itself.
        near = (matrix[2, 3] + 1.0) / matrix[2, 2]
        eye = eye - right * matrix[0, 3] / matrix[0, 0] - up * matrix[1, 3] / matrix[1, 1]
        eye, near = eye - min(near, 0.0) * back, max(near, 0.0)
        lens = {"height": 2.0 / matrix[1, 1]}
    else:
        near = matrix[2, 3] / (matrix[2, 2] - 1.0)
        if square and not matrix[:2, 2].any():
            lens = {"fov_y": math.degrees(2.0 * math.atan(1.0 / matrix[1, 1]))}
        else:
            focal = (0.5 * width * matrix[0, 0], 0.5 * height * matrix[1, 1])
            middle = (0.5 * width * (1.0 - matrix[0, 2]), 0.5 * height * (1.0 + matrix[1, 2]))
            lens = {"intrinsics": [*focal, *middle], "size": [float(width), float(height)]}
    return {"eye": eye, "target": eye - back, "up": up, "near": near, **lens}


def _particles(path, settings, frame):
    """The particle files as a table of a scene file."""
    pattern = particles.pattern_of(settings)
    folder = os.path.dirname(os.path.abspath(path))
    # A path to another drive is not relative.
    with contextlib.suppress(ValueError):
        pattern = os.path.relpath(pattern, folder)
    table = {"source": pattern.replace(os.sep, "/"), "up": settings.up.lower()}
    if particles.files_of(particles.pattern_of(settings)) is not None:
        table["frame"] = frame - settings.offset
    return table


def _table(name, values):
    """A table in TOML."""
    return f"\n[{name}]\n" + "".join(f"{key} = {_toml(value)}\n" for key, value in values.items())


def _toml(value):
    """A number, a list of numbers or a text in TOML."""
    if isinstance(value, (str, int)):
        return json.dumps(value, ensure_ascii=False)
    if np.ndim(value) == 0:
        return repr(float(value))
    return "[" + ", ".join(repr(float(number)) for number in value) + "]"
