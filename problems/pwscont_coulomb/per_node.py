"""Arguments for contact nodes: a number for all nodes, or a number for each node."""

from __future__ import annotations

from typing import Any

import numpy as np

from pwscont import InvalidInputError
from pwscont.extending import Array, finite_array


def positive(name: str, values: Any, p: int) -> Array:
    """Return a number, or p numbers, as p finite positive numbers."""
    array = per_node(name, values, p)
    if (array <= 0.0).any():
        raise InvalidInputError(f"{name} must be positive, got {array.min():.6g}")
    return array


def not_negative(name: str, values: Any, p: int) -> Array:
    """Return a number, or p numbers, as p finite numbers that are not negative."""
    array = per_node(name, values, p)
    if (array < 0.0).any():
        raise InvalidInputError(f"{name} must not be negative, got {array.min():.6g}")
    return array


def per_node(name: str, values: Any, p: int) -> Array:
    """Return a number, or p numbers, as p finite numbers."""
    array = finite_array(name, values)
    if array.shape not in ((), (p,)):
        raise InvalidInputError(f"{name} must be a number or {p} numbers, got shape {array.shape}")
    return np.broadcast_to(array, (p,)).copy()
