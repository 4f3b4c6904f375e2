"""The report of what limpid draws otherwise than Blender."""

import re

from .errors import line

# Names that a line lists; the others are counted.
_LISTED = 6


class Report:
    """Omissions and substitutes of a render, by the substitute. Says each thing once."""

    def __init__(self):
        self._found = {}
        self._said = set()

    def add(self, what, name="", user=""):
        """Notes `what` happens to the data block `name`, which the object `user` has."""
        users = self._found.setdefault(line(what), {}).setdefault(name, [])
        if user and user != name and user not in users:
            users.append(user)

    def take(self):
        """What was noted since the last time and not said yet, in one text; empty for nothing."""
        lines = []
        for what, names in self._found.items():
            # Numbers differ between the frames of an animation.
            new = [name for name in names if (re.sub(r"[\d.,]+", "", what), name) not in self._said]
            self._said |= {(re.sub(r"[\d.,]+", "", what), name) for name in new}
            if new:
                lines.append(": ".join(filter(None, [what, _listed(new, names)])))
        self._found = {}
        if len(lines) < 2:
            return "".join(lines)
        return "\n".join(["limpid draws some of this otherwise:", *lines])

    def forget(self):
        """Lets the next render say everything again."""
        self._found, self._said = {}, set()


def _listed(names, users):
    texts = []
    for name in sorted(names)[:_LISTED]:
        those = users[name][:_LISTED] + (["…"] if len(users[name]) > _LISTED else [])
        texts.append(f"{name} ({', '.join(those)})" if those else name)
    more = len(names) - _LISTED
    return ", ".join(texts) + (f" and {more} more" if more > 0 else "")
