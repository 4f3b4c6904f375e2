"""Blender's lights as suns and point lights."""

import math

import limpid
import numpy as np

from .axes import Y_UP

# As many as limpid draws.
_MOST = 16

# A sun of a greater angle, in radians, and a lamp of a greater radius, in metres, visibly have
# soft shadows.
_ANGLE, _RADIUS = 0.05, 0.25


def light_of(instance, report):
    """The light of an instance."""
    name, light = f"light {instance.object.name}", instance.object.data
    _say_otherwise(name, light, report)
    power = np.array(light.color) * light.energy
    if getattr(light, "use_temperature", False):
        power = power * np.array(light.temperature_color)
    power = power * 2.0 ** getattr(light, "exposure", 0.0)
    power = np.maximum(power, 0.0)
    normalize = getattr(light, "normalize", True)
    matrix = np.array(instance.matrix_world)
    if light.type == "SUN":
        # The strength is the irradiance of a surface that faces the sun, W/m². Without `normalize`
        # it is the radiance of its disc, whose solid angle, weighted by the cosine, is below.
        if not normalize:
            power = power * math.pi * math.sin(0.5 * light.angle) ** 2
        return limpid.Sun(tuple(Y_UP @ -matrix[:3, 2]), tuple(power))
    if light.type == "AREA":
        area = _area(light, matrix)
        power = power * (1.0 if normalize else area) * _focus(light.spread) / math.pi
        report.add("area lights shine as points, as bright to all sides as ahead", name)
    else:
        # The power P is that of a sphere that sends P / 4π W/sr everywhere, as the exporter to
        # glTF has it and Cycles draws it: a white floor h below sends P / (4π² h²) W/(m² sr).
        # Without `normalize` the power is that of each square metre of the sphere. A spot is a
        # point behind a mask.
        if not normalize:
            power = power * 4.0 * math.pi * light.shadow_soft_size**2
        power = power / (4.0 * math.pi)
        if light.type == "SPOT":
            report.add("spot lights shine to all sides", name)
    return limpid.PointLight(tuple(Y_UP @ matrix[:3, 3]), tuple(power))


def strongest(lights, report):
    """The lights that limpid can draw, of pairs of a name and a light."""

    def strength(named):
        light = named[1]
        sun = isinstance(light, limpid.Sun)
        return sun, sum(light.irradiance if sun else light.intensity)

    ordered = sorted(lights, key=strength, reverse=True)
    for name, _ in ordered[_MOST:]:
        report.add(f"of more than {_MOST} lights, the weakest are left out", f"light {name}")
    kept = {id(light) for _, light in ordered[:_MOST]}
    return [light for _, light in lights if id(light) in kept]


def _area(light, matrix):
    """The area of an area light, m²."""
    width, height = light.size, light.size
    if light.shape in {"RECTANGLE", "ELLIPSE"}:
        height = light.size_y
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    area = width * height * scale[0] * scale[1]
    return area * math.pi / 4.0 if light.shape in {"DISK", "ELLIPSE"} else area


def _focus(spread):
    """How much brighter a light of this spread, as of a grid before it, is ahead; as in Cycles."""
    half = 0.5 * spread
    if half > 0.5 * math.pi - 1e-4:
        return 1.0
    half = max(half, 0.5 * math.radians(1.0))
    return math.tan(half) / (math.tan(half) - half)


def _say_otherwise(name, light, report):
    soft = (
        light.angle > _ANGLE
        if light.type == "SUN"
        else light.type != "AREA" and light.shadow_soft_size > _RADIUS
    )
    if soft:
        report.add("soft shadows are drawn hard", name)
    if not light.use_shadow:
        report.add("lights without shadows cast them", name)
    if light.use_nodes and _has_own_nodes(light.node_tree):
        report.add("nodes of lights are left out", name)


def _has_own_nodes(tree):
    """Whether the nodes of a light do more than those that each has at first."""
    for node in tree.nodes if tree else ():
        if node.type not in {"EMISSION", "OUTPUT_LIGHT"}:
            return True
        if node.type == "EMISSION":
            color, strength = node.inputs["Color"], node.inputs["Strength"]
            if color.is_linked or strength.is_linked:
                return True
            if tuple(color.default_value)[:3] != (1, 1, 1) or strength.default_value != 1:
                return True
    return False
