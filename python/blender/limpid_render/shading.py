"""Shader nodes: the colours of materials and the light of the world."""

from dataclasses import dataclass

import numpy as np
from mathutils import Euler

# Colour in which Blender shows faces without a material.
_NO_MATERIAL = (0.8, 0.8, 0.8)

# Colour spaces of pictures of 8 bits whose numbers are linear.
_LINEAR = {"Non-Color", "Raw", "Linear", "Linear Rec.709", "Linear BT.709"}

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


def surface(material, notes):
    """Colour of a material, and whether it is light that the surface sends out."""
    if material is None:
        return _NO_MATERIAL, False
    viewport = tuple(material.diffuse_color[:3])
    output = material.node_tree and material.node_tree.get_output_node("ALL")
    shader = output and _source(output.inputs["Surface"])
    if not shader:
        return viewport, False
    inputs = shader.node.inputs
    if shader.node.type == "EMISSION":
        color = _constant(inputs["Color"])
        if color is not None:
            return tuple(inputs["Strength"].default_value * c for c in color), True
    else:
        socket = inputs.get("Base Color") or inputs.get("Color")
        color = socket and _constant(socket)
        if color is not None:
            return color, False
    _note(notes, f"material {material.name}: drawn in its viewport colour")
    return viewport, False


def world_light(world, notes):
    """The radiance of a world: one colour, or a map."""
    if world is None:
        return (0.0, 0.0, 0.0)
    output = world.node_tree and world.node_tree.get_output_node("ALL")
    if not output:
        return tuple(world.color)
    shader = _source(output.inputs["Surface"])
    if shader is None:
        return (0.0, 0.0, 0.0)
    if shader.node.type != "BACKGROUND":
        _note(notes, f"world {world.name}: drawn black, its surface is no Background node")
        return (0.0, 0.0, 0.0)
    strength = shader.node.inputs["Strength"].default_value
    socket = shader.node.inputs["Color"]
    color = _constant(socket)
    if color is not None:
        return tuple(strength * c for c in color)
    texture = _source(socket).node
    if texture.type != "TEX_ENVIRONMENT" or texture.image is None:
        _note(notes, f"world {world.name}: drawn grey, its colour is no environment texture")
        return (0.5 * strength,) * 3
    if texture.projection != "EQUIRECTANGULAR":
        _note(notes, f"image {texture.image.name}: drawn as if it were equirectangular")
    pixels = strength * _turned(_pixels(texture.image, notes), _mapping(texture, world, notes))
    return Map(np.clip(np.nan_to_num(pixels), 0.0, 1e12).astype(np.float32))


def _source(socket):
    """The output that a socket takes its value from, if there is one."""
    while socket.is_linked and not socket.links[0].is_muted:
        output = socket.links[0].from_socket
        if output.node.type != "REROUTE":
            return output
        socket = output.node.inputs[0]
    return None


def _constant(socket):
    """The colour of a socket that has one."""
    output = _source(socket)
    if output is None:
        return tuple(socket.default_value[:3])
    return tuple(output.default_value[:3]) if output.node.type == "RGB" else None


def _mapping(texture, world, notes):
    """The Mapping node that turns an environment texture, if there is one."""
    output = _source(texture.inputs["Vector"])
    mapping = None
    if output is not None and output.node.type == "MAPPING":
        mapping = output.node
        output = _source(mapping.inputs["Vector"])
    if output is not None and (output.node.type, output.identifier) != ("TEX_COORD", "Generated"):
        _note(notes, f"world {world.name}: its texture is drawn without {output.node.name}")
    return mapping


def _pixels(image, notes):
    """The linear pixels of an image, of shape (height, width, 3), rows from the top."""
    width, height = image.size
    if width * height == 0:
        _note(notes, f"image {image.name}: drawn black, it has no pixels")
        return np.zeros((1, 1, 3), np.float32)
    values = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(values)
    values = values.reshape(height, width, image.channels)[::-1]
    color = values[..., :3] if image.channels >= 3 else np.repeat(values[..., :1], 3, axis=2)
    # Blender holds pictures of floats in linear light, and those of bytes as the file has them.
    space = image.colorspace_settings.name
    if image.is_float or space in _LINEAR:
        return color
    if space != "sRGB":
        _note(notes, f"image {image.name}: drawn as if its colour space were sRGB")
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)


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
            direction = _mapped(direction, mapping)
        turned[rows] = _looked_up(picture, direction)
    return turned


def _mapped(direction, mapping):
    """Directions after a Mapping node."""
    location, rotation, scale = (
        np.array(mapping.inputs[name].default_value) if name in mapping.inputs else default
        for name, default in (("Location", 0.0), ("Rotation", np.zeros(3)), ("Scale", 1.0))
    )
    turn = np.array(Euler(rotation, "XYZ").to_matrix())
    safe = np.where(scale == 0.0, 1.0, scale)
    if mapping.vector_type == "TEXTURE":
        return (direction - location) @ turn / safe
    if mapping.vector_type == "NORMAL":
        return (direction / safe) @ turn.T
    moved = (direction * scale) @ turn.T
    return moved + location if mapping.vector_type == "POINT" else moved


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


def _note(notes, text):
    if text not in notes:
        notes.append(text)
