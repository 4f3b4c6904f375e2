"""Values of shader nodes, and pixels of images."""

import bpy
import numpy as np
from mathutils import Euler

# Colour spaces of pictures of 8 bits whose numbers are linear.
_LINEAR = {"Non-Color", "Raw", "Linear", "Linear Rec.709", "Linear BT.709"}


def tree_of(data):
    """The nodes of a material or a world, if it uses them, as those of Blender 5 always do."""
    return data.node_tree if bpy.app.version >= (5, 0) or data.use_nodes else None


def source(socket):
    """The output that a socket takes its value from, if there is one."""
    while socket.is_linked and not socket.links[0].is_muted:
        output = socket.links[0].from_socket
        if output.node.type != "REROUTE":
            return output
        socket = output.node.inputs[0]
    return None


def constant(socket):
    """The colour of a socket that has one."""
    output = source(socket)
    if output is None:
        return tuple(socket.default_value[:3])
    return tuple(output.default_value[:3]) if output.node.type == "RGB" else None


def mapped(places, mapping):
    """Places, or directions, after a Mapping node."""
    location, rotation, scale = (
        np.array(mapping.inputs[name].default_value) if name in mapping.inputs else default
        for name, default in (("Location", 0.0), ("Rotation", np.zeros(3)), ("Scale", 1.0))
    )
    turn = np.array(Euler(rotation, "XYZ").to_matrix())
    safe = np.where(scale == 0.0, 1.0, scale)
    if mapping.vector_type == "TEXTURE":
        return (places - location) @ turn / safe
    if mapping.vector_type == "NORMAL":
        return (places / safe) @ turn.T
    moved = (places * scale) @ turn.T
    return moved + location if mapping.vector_type == "POINT" else moved


def pixels(image, report):
    """The linear pixels of an image, of shape (height, width, 3), rows from the top."""
    width, height = image.size
    if width * height == 0:
        report.add("drawn black, as the image has no pixels", image.name)
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
        report.add("drawn as if the image's colour space were sRGB", image.name)
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)
