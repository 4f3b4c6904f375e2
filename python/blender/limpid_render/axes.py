"""Axes: Blender has z up and limpid y up, so (x, y, z) becomes (x, z, -y).

A unit of Blender is a metre.
"""

import numpy as np

# limpid's world from Blender's.
Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def particles_y_up(particles):
    """Particles in limpid's world, from Blender's or a file with z up."""
    for name in ("positions", "velocities"):
        rows = getattr(particles, name)
        if rows is not None:
            setattr(particles, name, rows @ Y_UP.T.astype(rows.dtype))
    if particles.ellipsoids is not None:
        particles.ellipsoids = Y_UP.astype(particles.ellipsoids.dtype) @ particles.ellipsoids
    return particles
