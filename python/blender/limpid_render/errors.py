"""Problems of scenes that cannot be drawn, in one line."""


class Problem(Exception):
    """A scene or a file that cannot be drawn, for a reason that its user can remove."""


class Stopped(Exception):
    """The user has asked to stop."""


def line(text):
    """A text as one line, since Blender reports lines."""
    return " ".join(str(text).split())


def line_of(error):
    """The text of an error; with its type, if that says more than the text."""
    explained = isinstance(error, (Problem, OSError, ValueError))
    explained = explained or type(error).__module__.split(".")[0] == "limpid"
    text = line(error)
    return text if explained and text else f"{type(error).__name__}: {text}"
