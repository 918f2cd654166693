"""What a problem is made of: given once, for what is computed from it is kept."""

from __future__ import annotations

from typing import Any, ClassVar, TypeVar

import numpy as np

from pwscont import InvalidInputError

Given = TypeVar("Given")


class Fixed:
    """An object of which some attributes are given once, and arrays in them are not written to."""

    #: The names of these attributes.
    _given: ClassVar[frozenset[str]] = frozenset()

    def __setattr__(self, name: str, value: Any) -> None:
        if name in self._given:
            if name in vars(self):
                kind = type(self).__name__
                raise InvalidInputError(f"{kind}.{name} cannot be changed: make a new {kind}")
            protected(value)
        super().__setattr__(name, value)

    def __setstate__(self, state: Any) -> None:
        """Take attributes over into a copy, or one in another process; slots come beside them."""
        attributes, slots = state if isinstance(state, tuple) else (state, {})
        vars(self).update(attributes or {})
        for name, value in slots.items():
            setattr(self, name, value)
        for name in self._given & vars(self).keys():
            protected(vars(self)[name])


def protected(value: Given) -> Given:
    """Return the same; a dense array cannot be written to any more."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    return value
