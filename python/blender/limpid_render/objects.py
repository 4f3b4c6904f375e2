"""Particles of an object: of its particle systems, point clouds, instances or vertices."""

from collections import defaultdict

import limpid
import numpy as np

from .axes import particles_y_up
from .errors import Problem

# Attributes of geometry that limpid takes by their type, with the property of a value and its size.
_TYPES = {
    "FLOAT": ("value", 1, np.float32),
    "INT": ("value", 1, np.int32),
    "INT8": ("value", 1, np.int32),
    "BOOLEAN": ("value", 1, bool),
    "FLOAT2": ("vector", 2, np.float32),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),
}


def is_part(instance, thing):
    """Whether an instance of the depsgraph is the object `thing` or what it makes."""
    owner = instance.parent if instance.is_instance else instance.object
    return owner is not None and owner.original == thing.original


def particles_of(depsgraph, thing, report):
    """Particles of an object in limpid's world, with attributes by name.

    They are those of its particle systems; if it has none, the points of its point clouds; else
    its instances, else its vertices: what Geometry Nodes make of it counts.
    """
    evaluated = thing.evaluated_get(depsgraph)
    rate = depsgraph.scene.render.fps / depsgraph.scene.render.fps_base
    systems = [s for s in evaluated.particle_systems if s.settings.type != "HAIR"]
    if systems:
        kind, parts = "particles", [_of_system(system, rate) for system in systems]
    else:
        kind, parts = _of_geometry(depsgraph, thing)
    parts = [part for part in parts if len(part["position"])]
    if not parts:
        report.add(f"no liquid, as the object has no {kind} at this frame", thing.name)
        return limpid.Particles(np.zeros((0, 3), np.float32)), {}
    shared = [name for name in parts[0] if all(name in part for part in parts)]
    values = {name: np.concatenate([part[name] for part in parts]) for name in shared}
    particles = limpid.Particles(
        values["position"], velocities=_of_width(values, "velocity", 3), radii=_radii(values, thing)
    )
    return particles_y_up(particles), values


def _of_system(system, rate):
    """The living particles of a particle system, in Blender's world."""
    particles = system.particles
    count = len(particles)
    alive = np.empty(count, np.int32)
    particles.foreach_get("alive_state", alive)
    living = particles[0].bl_rna.properties["alive_state"].enum_items["ALIVE"].value if count else 0
    chosen = alive == living
    values = {"size": np.empty(count, np.float32)}
    particles.foreach_get("size", values["size"])
    for name, key in (("location", "position"), ("velocity", "velocity")):
        values[key] = np.empty(3 * count, np.float32)
        particles.foreach_get(name, values[key])
        values[key] = values[key].reshape(-1, 3)
    if system.settings.type == "EMITTER":
        # In a frame, they move by the velocity times this step, whatever the rate of the scene.
        values["velocity"] *= system.settings.timestep * rate
    else:
        # Unknown units: those of fluids.
        del values["velocity"]
    values["id"] = np.arange(count, dtype=np.int32)
    return {name: rows[chosen] for name, rows in values.items()}


def _of_geometry(depsgraph, thing):
    """The kind of an object's geometry, and its parts, in Blender's world."""
    parts, instances = defaultdict(list), []
    for instance in depsgraph.object_instances:
        if not is_part(instance, thing):
            continue
        part, matrix = instance.object, np.array(instance.matrix_world)
        if part.type == "POINTCLOUD":
            parts["points"].append(_moved(_attributes(part.data, len(part.data.points)), matrix))
        elif instance.is_instance and part.type in {"MESH", "EMPTY"}:
            # Curves, texts and metaballs have their own surface as such an instance.
            instances.append((matrix[:3, 3], _radius_of_instance(part, matrix)))
        elif part.type == "MESH":
            parts["vertices"].append(_moved(_vertices(part.data), matrix))
    if instances:
        places, radii = (np.array(column, np.float32) for column in zip(*instances))
        parts["instances"].append({"position": places, "radius": radii})
    for kind in ("points", "instances"):
        if parts[kind]:
            return kind, parts[kind]
    return "vertices", parts["vertices"]


def _attributes(data, count):
    """The attributes of points, by name."""
    values = {}
    for attribute in data.attributes:
        if attribute.domain != "POINT" or attribute.data_type not in _TYPES:
            continue
        name, width, dtype = _TYPES[attribute.data_type]
        rows = np.empty(count * width, dtype)
        attribute.data.foreach_get(name, rows)
        rows = rows.reshape(count, width)
        values[attribute.name] = rows if width > 1 else rows[:, 0]
    return values


def _vertices(mesh):
    values = _attributes(mesh, len(mesh.vertices))
    if "position" not in values:
        values["position"] = np.empty((len(mesh.vertices), 3), np.float32)
        mesh.vertices.foreach_get("co", values["position"].reshape(-1))
    return values


def _moved(values, matrix):
    """Attributes in the world, of an object with this matrix."""
    linear = matrix[:3, :3].astype(np.float32)
    values["position"] = values["position"] @ linear.T + matrix[:3, 3].astype(np.float32)
    if _of_width(values, "velocity", 3) is not None:
        values["velocity"] = values["velocity"] @ linear.T
    if _of_width(values, "radius", 1) is not None:
        values["radius"] = values["radius"] * np.cbrt(abs(np.linalg.det(linear)))
    return values


def _radius_of_instance(part, matrix):
    """Half the mean extent of an instance, which is the radius of a ball; 0 for an empty."""
    if part.type == "EMPTY":
        return 0.0
    corners = np.array([corner[:] for corner in part.bound_box])
    sides = np.ptp(corners, axis=0) * np.linalg.norm(matrix[:3, :3], axis=0)
    return 0.5 * sides.mean()


def _of_width(values, name, width):
    """An attribute, if it has so many numbers for each particle."""
    rows = values.get(name)
    fits = rows is not None and rows.shape[1:] == ((width,) if width > 1 else ())
    return rows if fits and rows.dtype == np.float32 else None


def _radii(values, thing):
    """Radii, if the particles have any; they are not those of particle systems."""
    radii = _of_width(values, "radius", 1)
    if radii is None or not radii.any():
        return None
    if not (radii > 0.0).all():
        raise Problem(f"{thing.name}: {np.count_nonzero(~(radii > 0.0))} particles have no radius")
    return radii
