"""The particle file of a frame."""

import os
import re

import bpy

from .errors import Problem

# A placeholder for the frame's number, as limpid's own patterns have it: any number of digits, or
# at least as many as it says.
_PLACEHOLDER = re.compile(r"\{\}|(?P<hashes>#+)|%0?(?P<c>\d*)d|\$F(?P<houdini>\d*)")


def pattern_of(settings):
    """The absolute path of the file or of the pattern."""
    if not settings.particles.strip():
        raise Problem("no particles: choose a particle file in the render properties")
    return os.path.abspath(bpy.path.abspath(settings.particles.strip()))


def files_of(pattern):
    """The files of a pattern by their numbers; `None` for a file that is there."""
    if os.path.isfile(pattern):
        return None
    folder, name = os.path.split(pattern)
    found = _PLACEHOLDER.search(name)
    if found is None:
        raise Problem(f"there is no particle file {pattern}")
    hashes = len(found["hashes"] or "")
    digits = int(found["c"] or found["houdini"] or hashes or 1)
    before, after = re.escape(name[: found.start()]), re.escape(name[found.end() :])
    numbered = re.compile(rf"{before}(-?\d{{{digits},}}){after}")
    try:
        names = sorted(os.listdir(folder))
    except OSError as error:
        raise Problem(f"cannot list {folder}: {error.strerror}") from error
    matches = ((numbered.fullmatch(name), name) for name in names)
    files = {int(match[1]): os.path.join(folder, name) for match, name in matches if match}
    if not files:
        raise Problem(f"no particle file matches {pattern}")
    return files


def file_of_frame(settings, frame):
    """The file to draw at a frame of Blender's scene."""
    pattern = pattern_of(settings)
    files = files_of(pattern)
    if files is None:
        return pattern
    number = frame - settings.offset
    if number not in files:
        raise Problem(
            f"frame {number} is missing in {pattern}: there are {min(files)} to {max(files)}"
        )
    return files[number]


def first_file(settings):
    """The first file of a sequence, from which a radius is estimated that all frames share."""
    pattern = pattern_of(settings)
    files = files_of(pattern)
    return pattern if files is None else files[min(files)]
