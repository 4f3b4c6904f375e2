"""Render passes in Blender's conventions, from limpid's images."""

import numpy as np

from .axes import Y_UP

# Depth of what is empty, as Cycles has it.
_FAR = 1e10

# Seconds of limpid's motion vectors.
_MOTION = 1.0 / 30.0


def offered(layer):
    """The passes that a view layer asks for, as Blender registers them."""
    passes = [("Combined", 4, "RGBA", "COLOR")]
    if layer.use_pass_z:
        passes.append(("Depth", 1, "Z", "VALUE"))
    if layer.use_pass_normal:
        passes.append(("Normal", 3, "XYZ", "VECTOR"))
    if layer.use_pass_vector:
        passes.append(("Vector", 4, "XYZW", "VECTOR"))
    return passes


def images(layer):
    """The names of limpid's images from which the passes of a view layer are made."""
    if not (layer.use_pass_z or layer.use_pass_normal or layer.use_pass_vector):
        return []
    names = ["depth", "solid_depth"]
    if layer.use_pass_normal:
        names.append("normal")
    if layer.use_pass_vector:
        names.append("motion")
    return names


def made(layer, picture, radiance, cameras, rate):
    """The passes of a picture by name, of shape (height, width, channels), rows from the top.

    `cameras` are those of this frame, and with motion vectors of the last and the next frame;
    `rate` is the number of frames in a second.
    """
    combined = np.ones((*radiance.shape[:2], 4), np.float32)
    combined[..., : radiance.shape[2]] = radiance
    found = {"Combined": combined}
    if not images(layer):
        return found
    depth, of_liquid = _depth(picture.aov)
    if layer.use_pass_z:
        found["Depth"] = depth[..., None]
    camera = cameras[0]
    places = _places(camera, depth)
    if layer.use_pass_normal:
        turn = Y_UP.T @ camera.view[:3, :3].T
        normals = np.where(of_liquid[..., None], picture.aov["normal"], _normals(places, depth))
        found["Normal"] = (normals @ turn.T).astype(np.float32)
    if layer.use_pass_vector:
        motion = picture.aov["motion"] * of_liquid[..., None] / (_MOTION * rate)
        found["Vector"] = _vectors(motion, places, depth, cameras)
    return found


def _depth(aov):
    """Depth along the view direction, and where it is that of the liquid."""
    liquid, solid = (
        np.where(aov[name] > 0.0, aov[name], _FAR) for name in ("depth", "solid_depth")
    )
    return np.minimum(liquid, solid).astype(np.float32), liquid < solid


def _places(camera, depth):
    """The first surface in each pixel, in view space."""
    height, width = depth.shape
    matrix = camera.projection
    across = (np.arange(width) + 0.5) / width * 2.0 - 1.0
    down = 1.0 - (np.arange(height) + 0.5) / height * 2.0
    z = -depth.astype(np.float64)
    w = matrix[3, 2] * z + matrix[3, 3]
    x = (across * w - matrix[0, 2] * z - matrix[0, 3]) / matrix[0, 0]
    y = (down[:, None] * w - matrix[1, 2] * z - matrix[1, 3]) / matrix[1, 1]
    return np.stack([x, y, z], axis=-1)


def _normals(places, depth):
    """Normals of solids in view space, from the places that neighbouring pixels see; 0 for none.

    Along either axis the neighbour counts whose depth differs less, so that edges stay sharp.
    """
    sides = []
    for axis in (1, 0):
        ahead = np.diff(places, axis=axis, append=np.take(places, [-1], axis))
        behind = np.roll(ahead, 1, axis)
        jump = np.abs(ahead[..., 2]), np.abs(behind[..., 2])
        # At the borders there is one neighbour.
        first, last = [slice(None)] * 2, [slice(None)] * 2
        first[axis], last[axis] = 0, -1
        jump[1][tuple(first)], jump[0][tuple(last)] = np.inf, np.inf
        sides.append(np.where((jump[0] <= jump[1])[..., None], ahead, behind))
    right, down = sides
    normals = np.cross(down, right)
    # Towards the eye.
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    good = (length > 0.0) & (depth < _FAR)[..., None]
    return np.where(good, normals / np.where(length > 0.0, length, 1.0), 0.0)


def _vectors(motion, places, depth, cameras):
    """Motion in pixels, right and up: to the last frame's place, and from the next one's.

    The liquid moves by its velocities, and all by the camera; solids that move do not.
    """
    now, last, following = cameras
    height, width = depth.shape
    own = np.where((depth < _FAR)[..., None], motion * (1.0, -1.0), 0.0)
    here = _landed(now, places, width, height)
    to_world = np.linalg.inv(now.view)
    world = places @ to_world[:3, :3].T + to_world[:3, 3]
    back, forth = (
        _landed(camera, world @ camera.view[:3, :3].T + camera.view[:3, 3], width, height)
        for camera in (last, following)
    )
    vectors = np.concatenate([back - here - own, here - forth - own], axis=-1)
    return np.nan_to_num(vectors).astype(np.float32)


def _landed(camera, places, width, height):
    """Where places in view space land in a picture, in pixels right and up."""
    matrix = camera.projection
    clip = places @ matrix[:, :3].T + matrix[:, 3]
    w = np.where(np.abs(clip[..., 3:]) > 1e-30, clip[..., 3:], np.nan)
    return clip[..., :2] / w * (0.5 * width, 0.5 * height)
