"""Surfaces of objects as limpid's meshes."""

from dataclasses import dataclass

import limpid
import numpy as np

from .axes import Y_UP
from .nodes import mapped, pixels
from .shading import look_of


@dataclass
class Shape:
    """A part of an object's surface in limpid's world, of one colour or with one picture."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    smooth: bool
    # Whether the colour is light that the surface sends out.
    emits: bool
    # Whether lights illuminate it.
    lit: bool = False
    color: np.ndarray | None = None
    # A linear picture, and for each vertex where in it it lies, from its upper left corner.
    picture: np.ndarray | None = None
    coordinates: np.ndarray | None = None

    def dim(self, share):
        """Multiplies the colours by this share of red, green and blue."""
        if self.picture is None:
            self.color = self.color * share
        else:
            self.picture = self.picture * np.asarray(share, np.float32)


def shapes_of(instance, pictures, report):
    """The parts of an object's surface that differ in more than colour, each a shape.

    `pictures` has the pixels of images by name, and gets those of others.
    """
    thing = instance.object
    mesh = thing.data
    if len(mesh.polygons) == 0:
        return []
    mesh.calc_loop_triangles()
    faces = _read(mesh.loop_triangles, "vertices", 3, np.int32)
    slots = _read(mesh.loop_triangles, "material_index", 1, np.int32)[:, 0]
    smooth = _read(mesh.polygons, "use_smooth", 1, bool).mean() >= 0.5
    materials = [slot.material for slot in thing.material_slots] or list(mesh.materials) or [None]
    looks = [look_of(material, thing.name, report) for material in materials]
    slots = np.clip(slots, 0, len(looks) - 1)

    matrix = np.array(instance.matrix_world)
    vertices = _read(mesh.vertices, "co", 3, np.float32).astype(np.float64)
    vertices = (vertices @ matrix[:3, :3].T + matrix[:3, 3]) @ Y_UP.T
    # A mirrored mesh would be inside out.
    order = [0, 1, 2] if np.linalg.det(matrix[:3, :3]) > 0.0 else [2, 1, 0]

    # Slots of plain colours, of light or not, share a shape; each texture has its own.
    kinds = [(look.emits, look.texture and number) for number, look in enumerate(looks)]
    parts = []
    for kind in dict.fromkeys(kinds[slot] for slot in np.unique(slots)):
        chosen = np.isin(slots, [number for number, own in enumerate(kinds) if own == kind])
        shape = Shape(thing.name, vertices, faces[chosen][:, order], bool(smooth), kind[0])
        texture = looks[slots[chosen][0]].texture
        if texture is not None:
            _cover(shape, mesh, np.flatnonzero(chosen), order, texture, pictures, report)
        else:
            _paint(shape, slots[chosen], np.array([look.color for look in looks]))
        parts.append(shape)
    if len(parts) > 1:
        report.add("objects with several textures, or some light, have no dry inside", thing.name)
    return parts


def solid_of(shape):
    """A solid of limpid that is in memory."""
    if shape.picture is None:
        look = {"color": tuple(shape.color)}
    else:
        look = {"texture": encoded(shape.picture), "coordinates": shape.coordinates}
    return limpid.Mesh(
        vertices=shape.vertices,
        faces=shape.faces,
        normals="smooth" if shape.smooth else "flat",
        lit=shape.lit,
        **look,
    )


def encoded(picture):
    """A linear picture in sRGB, of bytes."""
    linear = np.clip(picture, 0.0, 1.0)
    curve = np.where(
        linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055
    )
    return np.round(255.0 * curve).astype(np.uint8)


def _paint(shape, slots, colors):
    """Gives a shape the colours of its faces' materials, which are in `slots`."""
    used, color_of_face = np.unique(slots, return_inverse=True)
    if len(used) == 1:
        shape.color = colors[used[0]]
        return
    # A picture of one row; a vertex between two materials becomes two.
    corner = shape.faces.astype(np.int64) * len(used) + color_of_face.reshape(-1, 1)
    kept, faces = np.unique(corner, return_inverse=True)
    shape.faces = faces.reshape(-1, 3)
    shape.vertices = shape.vertices[kept // len(used)]
    across = (kept % len(used) + 0.5) / len(used)
    shape.picture = colors[used][None].astype(np.float32)
    shape.coordinates = np.stack([across, np.full_like(across, 0.5)], axis=1)


def _cover(shape, mesh, triangles, order, texture, pictures, report):
    """Gives a shape of these loop triangles the picture of a texture."""
    image = texture.image
    if image.name not in pictures:
        pictures[image.name] = pixels(image, report)
    picture = pictures[image.name]
    layers = mesh.uv_layers
    active = next((layer for layer in layers if layer.active_render), None)
    layer = layers.get(texture.uv_map) if texture.uv_map else active
    if layer is None or not texture.by_uv:
        report.add("textures that do not lie on UVs are drawn in their mean colour", shape.name)
        shape.color = picture.mean(axis=(0, 1))
        return
    loops = _read(mesh.loop_triangles, "loops", 3, np.int32)[triangles][:, order].ravel()
    places = np.zeros((len(loops), 3))
    places[:, :2] = _read(layer.uv, "vector", 2, np.float32)[loops]
    if texture.mapping is not None:
        places = mapped(places, texture.mapping)
    if not texture.repeats and (places[:, :2].min() < -1e-3 or places[:, :2].max() > 1.001):
        report.add("images that end at their edge are repeated", f"image {image.name}", shape.name)
    # limpid joins vertices at the same place.
    shape.vertices = shape.vertices[shape.faces.ravel()]
    shape.faces = np.arange(len(loops)).reshape(-1, 3)
    shape.picture = picture
    shape.coordinates = np.stack([places[:, 0], 1.0 - places[:, 1]], axis=1)


def _read(collection, name, width, dtype):
    values = np.empty(len(collection) * width, dtype)
    collection.foreach_get(name, values)
    return values.reshape(-1, width)
