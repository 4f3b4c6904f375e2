"""Objects whose attributes are those of their class."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING, Any


class Strict:
    """An object to which no attribute can be added by mistake."""

    if not TYPE_CHECKING:
        # Type checkers know the attributes, and take this method for a permission.
        def __setattr__(self, name: str, value: Any) -> None:
            kind = type(self)
            fields = getattr(kind, "__dataclass_fields__", ())
            if not (name.startswith("_") or name in fields or hasattr(kind, name)):
                known = sorted({*fields, *(own for own in dir(kind) if not own.startswith("_"))})
                raise AttributeError(
                    f"{kind.__name__} has no attribute {name!r}{nearest(name, known)}", name=name, obj=self
                )
            super().__setattr__(name, value)


def nearest(name: str, known: list[str]) -> str:
    """A question for the name that was meant, if there is one."""
    found = difflib.get_close_matches(name, known, 1)
    return f"; did you mean {found[0]!r}?" if found else f"; it has {', '.join(known)}"
