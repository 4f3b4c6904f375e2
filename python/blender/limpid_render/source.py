"""The liquid of a frame: particles of a file or of an object, and their colours."""

import os
from dataclasses import dataclass, field

import limpid
import numpy as np

from . import objects, particles
from .axes import particles_y_up
from .errors import Problem


@dataclass
class Liquid:
    """Particles in limpid's world."""

    particles: limpid.Particles
    # By which attribute they are coloured: arguments of limpid's `render`.
    coloring: dict = field(default_factory=dict)


def name_of(settings, frame):
    """What a user calls the source."""
    if settings.source == "OBJECT":
        return _object(settings).name
    return os.path.basename(particles.file_of_frame(settings, frame))


def liquid_of(depsgraph, report):
    """The liquid of an evaluated scene."""
    scene = depsgraph.scene
    settings = scene.limpid
    if settings.source == "OBJECT":
        found, attributes = objects.particles_of(depsgraph, _object(settings), report)
    else:
        found = limpid.read(particles.file_of_frame(settings, scene.frame_current))
        columns = {"velocity": found.velocities, "density": found.densities, "radius": found.radii}
        attributes = {name: rows for name, rows in columns.items() if rows is not None}
        if settings.up == "Z":
            found = particles_y_up(found)
    return Liquid(found, _coloring(found, attributes, settings))


def is_source(instance, settings):
    """Whether an instance of the depsgraph is the liquid, and so no obstacle."""
    chosen = settings.object if settings.source == "OBJECT" else None
    return chosen is not None and objects.is_part(instance, chosen)


def _object(settings):
    if settings.object is None:
        raise Problem("no particles: choose an object in the render properties")
    return settings.object


def _coloring(found, attributes, settings):
    name = settings.attribute.strip()
    if not name or not len(found):
        return {}
    if name not in attributes:
        there = ", ".join(sorted(attributes)) or "none"
        raise Problem(f"the particles have no attribute {name}; there are: {there}")
    rows = attributes[name]
    if rows.ndim == 2 and rows.shape[1] == 4:
        return {"colors": np.clip(rows[:, :3], 0.0, 1.0)}
    low, high = settings.range
    return {
        "values": rows.astype(np.float32),
        "colormap": settings.colormap.lower(),
        "range": (low, high) if low < high else None,
    }
