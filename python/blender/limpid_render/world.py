"""The light of the world."""

from dataclasses import dataclass

import numpy as np

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


def world_light(world, report):
    """The radiance of a world: one colour, or a map."""
    if world is None:
        return (0.0, 0.0, 0.0)
    tree = tree_of(world)
    output = tree and tree.get_output_node("ALL")
    if not output:
        return tuple(world.color)
    if output.inputs["Volume"].is_linked:
        report.add("drawn without its volume", f"world {world.name}")
    shader = source(output.inputs["Surface"])
    if shader is None:
        return (0.0, 0.0, 0.0)
    if shader.node.type != "BACKGROUND":
        report.add("drawn black, as the surface is no Background node", f"world {world.name}")
        return (0.0, 0.0, 0.0)
    strength = shader.node.inputs["Strength"].default_value
    socket = shader.node.inputs["Color"]
    color = constant(socket)
    if color is not None:
        return tuple(strength * c for c in color)
    texture = source(socket).node
    if texture.type != "TEX_ENVIRONMENT" or texture.image is None:
        report.add("drawn grey, as the colour is no environment texture", f"world {world.name}")
        return (0.5 * strength,) * 3
    if texture.projection != "EQUIRECTANGULAR":
        report.add("drawn as if the image were equirectangular", f"image {texture.image.name}")
    picture = strength * _turned(pixels(texture.image, report), _mapping(texture, world, report))
    return Map(np.clip(np.nan_to_num(picture), 0.0, 1e12).astype(np.float32))


def _mapping(texture, world, report):
    """The Mapping node that turns an environment texture, if there is one."""
    output = source(texture.inputs["Vector"])
    mapping = None
    if output is not None and output.node.type == "MAPPING":
        mapping = output.node
        output = source(mapping.inputs["Vector"])
    if output is not None and (output.node.type, output.identifier) != ("TEX_COORD", "Generated"):
        report.add(f"the texture is drawn without the node {output.node.name}", f"world {world.name}")
    return mapping


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
