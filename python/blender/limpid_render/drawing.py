"""Pictures by limpid, drawn while Blender shows progress and may ask to stop."""

import os
import threading
import time
import warnings

import limpid

from . import particles
from .errors import Stopped, line

# The renderer, whose pipelines serve all pictures: opened for the first.
_renderer = None

# Radii that were estimated, by source.
_radii = {}

# Seconds that the last picture took for each million rays.
_pace = None

# Seconds between two looks at whether to stop.
_PATIENCE = 0.05


def close():
    """Closes the renderer, if one is open."""
    global _renderer
    if _renderer is not None:
        _renderer.close()
        _renderer = None


def forget():
    """Forgets what is estimated anew for each render, of one picture or of many."""
    for source in [source for source in _radii if isinstance(source, str)]:
        del _radii[source]


def draw(liquid, settings, watch, report, **arguments):
    """The picture of a liquid, and its radiance.

    `watch` is called with the share that is likely done, and returns whether to stop: then
    `Stopped` is raised at once, while limpid ends the picture by itself.
    """
    global _pace
    width, height = arguments["size"]
    rays = 1e-6 * width * height * settings.samples
    source, radius = _radius(liquid.particles, settings, watch, report)
    start = time.monotonic()

    def share():
        return 0.0 if _pace is None else min((time.monotonic() - start) / (_pace * rays), 1.0)

    def work():
        picture = _open_renderer().render(
            liquid.particles,
            radius=radius,
            samples=settings.samples,
            **liquid.coloring,
            **arguments,
        )
        return picture, picture.radiance

    picture, radiance = _watched(work, lambda: watch(share()), report)
    _pace = (time.monotonic() - start) / rays
    if source is not None and len(liquid.particles):
        _radii[source] = picture.radius
    return picture, radiance


def _watched(work, stops, report):
    """The result of `work` in a thread, unless it is asked to stop before."""
    outcome = {}

    def run():
        try:
            outcome["result"] = work()
        except BaseException as error:
            outcome["error"] = error

    thread = threading.Thread(target=run, name="limpid", daemon=True)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", limpid.LimpidWarning)
        thread.start()
        while thread.is_alive():
            thread.join(_PATIENCE)
            if stops():
                raise Stopped
    for warning in caught:
        if issubclass(warning.category, limpid.LimpidWarning):
            report.add(line(warning.message))
    if "error" in outcome:
        raise outcome["error"]
    return outcome["result"]


def _open_renderer():
    global _renderer
    if _renderer is None:
        _renderer = limpid.Renderer()
    return _renderer


def _radius(liquid, settings, watch, report):
    """For what source a radius is estimated, if it is, and the radius if it is known."""
    if settings.radius > 0.0:
        return None, settings.radius
    if liquid.radii is not None or liquid.radius is not None:
        return None, None
    # Estimated once for all frames of a sequence, or the liquid would swell and shrink.
    if settings.source == "OBJECT":
        source = settings.object.name
    else:
        file = particles.first_file(settings)
        source = (file, os.stat(file).st_mtime_ns)
        if source not in _radii:
            first = limpid.read(file)

            def work():
                return _open_renderer().render(first, size=(16, 16)).radius

            _radii[source] = _watched(work, lambda: watch(0.0), report)
    return source, _radii.get(source)
