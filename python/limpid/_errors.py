"""Exceptions and warnings."""

import sys
import warnings


class Error(Exception):
    """Any failure of limpid that no other exception names."""


class SceneError(Error, ValueError):
    """A scene, a setting or a camera that cannot be used."""


class FileError(Error, OSError):
    """A file that is damaged, of another format than expected, or missing in a sequence.

    Files that cannot be opened raise the usual ``OSError``, such as ``FileNotFoundError``.
    """


class NoAdapter(Error):
    """There is no graphics adapter, or none that fits; software ones count."""


class DeviceLost(Error):
    """The graphics device failed. The next picture opens it anew."""


class Cancelled(Error):
    """The function given as ``progress`` has returned ``False``."""


class LimpidWarning(UserWarning):
    """A likely reason for an unexpected picture: a wrong unit, particles outside the picture."""


def warn(text: str) -> None:
    """Warns the code that called this package."""
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith("limpid."):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, LimpidWarning, stacklevel=level + 1)
