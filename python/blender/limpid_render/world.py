"""The light of the world."""

from dataclasses import dataclass

import limpid
import numpy as np

from . import bake
from .axes import Y_UP
from .nodes import constant, mapped, pixels, source, tree_of

# Rows of an environment that are resampled at a time, to bound the memory.
_ROWS = 64


@dataclass
class Map:
    """Radiance by direction, equirectangular: the centre is -z of limpid, the top row +y."""

    pixels: np.ndarray

    def mean(self):
        """Mean radiance over all directions."""
        height = len(self.pixels)
        weights = np.sin((np.arange(height) + 0.5) * np.pi / height)
        return np.average(self.pixels.mean(axis=1), axis=0, weights=weights)


def world_light(world, frame, wait, report):
    """The radiance of a world, one colour or a map, and the suns of its sky.

    Cycles draws what is no plain texture; `wait` is called meanwhile and may raise.
    """
    if world is None:
        return (0.0, 0.0, 0.0), []
    tree = tree_of(world)
    output = tree and tree.get_output_node("ALL")
    if not output:
        return tuple(world.color), []
    name = f"world {world.name}"
    if output.inputs["Volume"].is_linked:
        report.add("volumes are left out", name)
    shader = source(output.inputs["Surface"])
    if shader is None:
        return (0.0, 0.0, 0.0), []
    plain = _plain(shader.node, report)
    if plain is not None:
        return plain, []
    try:
        picture, suns = bake.baked(world, frame, wait)
    except (bake.Failed, OSError) as error:
        report.add(f"drawn grey, as Cycles could not draw the world ({error})", name)
        return (0.5, 0.5, 0.5), []
    if suns:
        report.add("the sun of the sky lights the scene, and is not seen itself", name)
    suns = [limpid.Sun(tuple(Y_UP @ -way), tuple(power)) for way, power in suns if power.any()]
    return _map(picture), suns


def _plain(node, report):
    """The radiance of a Background node of one colour or of an equirectangular texture."""
    if node.type != "BACKGROUND" or source(node.inputs["Strength"]) is not None:
        return None
    strength = node.inputs["Strength"].default_value
    color = constant(node.inputs["Color"])
    if color is not None:
        return tuple(strength * c for c in color)
    texture = source(node.inputs["Color"]).node
    if texture.type != "TEX_ENVIRONMENT" or texture.image is None:
        return None
    mapping, known = _mapping(texture)
    if not known or texture.projection != "EQUIRECTANGULAR":
        return None
    return _map(strength * _turned(pixels(texture.image, report), mapping))


def _map(picture):
    return Map(np.clip(np.nan_to_num(picture), 0.0, 1e12).astype(np.float32))


def _mapping(texture):
    """The Mapping node that turns an environment texture, if there is one alone."""
    output = source(texture.inputs["Vector"])
    mapping = None
    if output is not None and output.node.type == "MAPPING":
        mapping = output.node
        output = source(mapping.inputs["Vector"])
        if any(socket.is_linked for socket in mapping.inputs if socket.name != "Vector"):
            return None, False
    known = output is None or (output.node.type, output.identifier) == ("TEX_COORD", "Generated")
    return mapping, known


def _turned(picture, mapping):
    """A picture in limpid's orientation, from one in Blender's: centre +x, top row +z."""
    height, width = picture.shape[:2]
    longitude = ((np.arange(width) + 0.5) / width - 0.5) * 2.0 * np.pi
    turned = np.empty_like(picture)
    for top in range(0, height, _ROWS):
        rows = np.arange(top, min(top + _ROWS, height))
        polar = ((rows + 0.5) / height * np.pi)[:, None]
        # limpid's (x, y, z) = (sin, cos, -cos) is (x, -z, y) in Blender.
        direction = np.stack(
            [
                np.sin(polar) * np.sin(longitude),
                np.sin(polar) * np.cos(longitude),
                np.broadcast_to(np.cos(polar), (len(rows), width)),
            ],
            axis=-1,
        )
        if mapping is not None:
            direction = mapped(direction, mapping)
        turned[rows] = _looked_up(picture, direction)
    return turned


def _looked_up(picture, direction):
    """A picture in these directions of Blender's world, interpolated between the pixels."""
    height, width = picture.shape[:2]
    x, y, z = np.moveaxis(direction, -1, 0)
    across = (0.5 - np.arctan2(y, x) / (2.0 * np.pi)) * width - 0.5
    down = np.arctan2(np.hypot(x, y), z) / np.pi * height - 0.5
    left, above = np.floor(across).astype(int), np.floor(down).astype(int)
    share_x, share_y = (across - left)[..., None], (down - above)[..., None]

    def row(number):
        number = np.clip(number, 0, height - 1)
        start, end = picture[number, left % width], picture[number, (left + 1) % width]
        return start + share_x * (end - start)

    upper, lower = row(above), row(above + 1)
    return upper + share_y * (lower - upper)
