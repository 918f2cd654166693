"""Objects with fixed data: values computed from the data are kept, and must stay right."""

from __future__ import annotations

from typing import Any, ClassVar, TypeVar

import numpy as np

from pwscont import InvalidInputError

Given = TypeVar("Given")


class Fixed:
    """An object with attributes that are set once; arrays among the attributes are read-only."""

    #: The names of the attributes that are set once.
    _given: ClassVar[frozenset[str]] = frozenset()

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self._given:
            if name in vars(self):
                kind = type(self).__name__
                raise InvalidInputError(f"{kind}.{name} cannot be changed: make a new {kind}")
            protected(value)
        super().__setattr__(name, value)

    def __setstate__(self, state: Any) -> None:
        """Set the attributes of a copy, also in another process, from a dict or (dict, slots)."""
        attributes, slots = state if isinstance(state, tuple) else (state, {})
        vars(self).update(attributes or {})
        for name, value in slots.items():
            setattr(self, name, value)
        for name in self._given & vars(self).keys():
            protected(vars(self)[name])


def protected(value: Given) -> Given:
    """Return the given value; a dense array becomes read-only."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    return value
