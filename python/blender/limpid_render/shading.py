"""Looks of surfaces, from the shader nodes of materials."""

from dataclasses import dataclass

from .nodes import constant, source, tree_of

# Colour in which Blender shows faces without a material.
_NO_MATERIAL = (0.8, 0.8, 0.8)

# Shaders that limpid draws otherwise, in their colour.
_OTHERWISE = {
    "BSDF_GLASS": "glass is drawn opaque",
    "BSDF_REFRACTION": "glass is drawn opaque",
    "BSDF_TRANSPARENT": "transparency is drawn opaque",
    "BSDF_TRANSLUCENT": "translucency is drawn opaque",
    "BSDF_GLOSSY": "metal and gloss are drawn matt",
    "BSDF_METALLIC": "metal and gloss are drawn matt",
    "SUBSURFACE_SCATTERING": "subsurface scattering is left out",
}

# Inputs of the Principled BSDF with the value that changes nothing.
_PRINCIPLED = {
    "Transmission Weight": (0.0, "glass is drawn opaque"),
    "Alpha": (1.0, "transparency is drawn opaque"),
    "Metallic": (0.0, "metal and gloss are drawn matt"),
    "Coat Weight": (0.0, "metal and gloss are drawn matt"),
    "Sheen Weight": (0.0, "sheen is left out"),
    "Subsurface Weight": (0.0, "subsurface scattering is left out"),
    "Thin Film Thickness": (0.0, "thin films are left out"),
}

# A Principled BSDF of less roughness visibly mirrors its surroundings.
_GLOSSY = 0.25


@dataclass
class Texture:
    """An image on a surface: by the UVs of a map, "" for the active one, after a Mapping node."""

    image: object
    uv_map: str
    mapping: object
    repeats: bool
    # Whether it lies on UVs at all.
    by_uv: bool


@dataclass
class Look:
    """The colour of a surface, and whether it is light that the surface sends out."""

    color: tuple[float, float, float]
    emits: bool = False
    # A picture instead of the colour.
    texture: Texture | None = None


def look_of(material, user, report):
    """The look of a material of the object `user`."""
    if material is None:
        return Look(_NO_MATERIAL)
    viewport = Look(tuple(material.diffuse_color[:3]))
    tree = tree_of(material)
    output = tree and tree.get_output_node("ALL")
    if not output:
        return viewport
    name = f"material {material.name}"
    if output.inputs["Volume"].is_linked:
        report.add("volumes are left out", name, user)
    if output.inputs["Displacement"].is_linked:
        report.add("displacement and bumps are left out", name, user)
    shader = source(output.inputs["Surface"])
    if shader is None:
        return viewport
    node = shader.node
    _say_otherwise(node, name, user, report)
    emission = _emission(node)
    if emission is not None:
        return Look(emission, emits=True)
    socket = node.inputs.get("Base Color") or node.inputs.get("Color")
    emits = node.type == "EMISSION"
    color = socket and not emits and constant(socket)
    if color:
        return Look(color)
    texture = socket and _texture(socket)
    if texture is not None and (not emits or node.inputs["Strength"].default_value == 1.0):
        if texture.image.source in {"SEQUENCE", "MOVIE", "TILED"}:
            report.add("of films and tiled images, one picture is drawn", name, user)
        return Look(viewport.color, emits, texture)
    after = source(socket).node.name if socket and source(socket) else node.name
    what = f"drawn in the viewport colour, as limpid does not know the node {after}"
    report.add(what, name, user)
    return viewport


def _texture(socket):
    """The image that colours a socket, if one does alone."""
    output = source(socket)
    if output is None or (output.node.type, output.identifier) != ("TEX_IMAGE", "Color"):
        return None
    node = output.node
    if node.image is None:
        return None
    uv_map, mapping = "", None
    place = source(node.inputs["Vector"])
    if place is not None and place.node.type == "MAPPING":
        mapping = place.node
        place = source(mapping.inputs["Vector"])
    by_uv = node.projection == "FLAT"
    if place is not None:
        known = {("UVMAP", "UV"), ("TEX_COORD", "UV")}
        by_uv = by_uv and (place.node.type, place.identifier) in known
        uv_map = place.node.uv_map if place.node.type == "UVMAP" else ""
    return Texture(node.image, uv_map, mapping, node.extension == "REPEAT", by_uv)


def _emission(node):
    """The constant radiance of a shader that is light alone."""
    if node.type == "EMISSION":
        color, strength = constant(node.inputs["Color"]), node.inputs["Strength"]
        return None if color is None else tuple(strength.default_value * c for c in color)
    if node.type != "BSDF_PRINCIPLED":
        return None
    color, base = constant(node.inputs["Emission Color"]), constant(node.inputs["Base Color"])
    strength = node.inputs["Emission Strength"]
    if base != (0.0, 0.0, 0.0) or color is None or strength.is_linked:
        return None
    return tuple(strength.default_value * c for c in color) if strength.default_value else None


def _say_otherwise(node, name, user, report):
    """Reports what limpid does not draw of a shader."""
    if node.type in _OTHERWISE:
        report.add(_OTHERWISE[node.type], name, user)
    normal = node.inputs.get("Normal")
    if normal is not None and normal.is_linked:
        report.add("displacement and bumps are left out", name, user)
    if node.type != "BSDF_PRINCIPLED":
        return
    for socket, (neutral, what) in _PRINCIPLED.items():
        socket = node.inputs.get(socket)
        if socket is not None and (socket.is_linked or socket.default_value != neutral):
            report.add(what, name, user)
    roughness = node.inputs["Roughness"]
    if not roughness.is_linked and roughness.default_value < _GLOSSY:
        report.add("metal and gloss are drawn matt", name, user)
    strength, color = node.inputs["Emission Strength"], constant(node.inputs["Emission Color"])
    shines = strength.is_linked or strength.default_value != 0.0 and color != (0.0, 0.0, 0.0)
    if shines and _emission(node) is None:
        report.add("light of surfaces that also have a colour is left out", name, user)
