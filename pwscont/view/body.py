"""The records of a body: shapes for every row of numbers, and contact states for each piece."""

from __future__ import annotations

from typing import Any

import numpy as np

from pwscont import BranchGraph, InvalidSystemError
from pwscont.extending import Array, Indices
from pwscont.scenes.panels import CONTACT_STATES, BodyPicture, Shapes
from pwscont.view.numbers import Numbers
from pwscont.view.records import packed

#: Most numbers of all shapes, four bytes each, so that a page stays small; of a larger body only
#: the outline is shown.
MOST_NUMBERS = 800_000


def body_records(graph: BranchGraph, numbers: Numbers, body: BodyPicture) -> dict[str, Any]:
    """Return the records of a body for the page."""
    shapes = body.shapes(numbers.states)
    mesh = _drawn_elements(shapes) if _is_small(shapes) else _drawn_outline(shapes)
    return mesh | {
        "tangents": shapes.tangents.T.tolist(),
        "arc": shapes.arc.tolist(),
        "part": shapes.part.tolist(),
        "obstacles": [outline.tolist() for outline in shapes.obstacles],
        "curves": packed(_curves(shapes), "Float32Array"),
        "states": [_states(piece.character, shapes, body) for piece in graph.pieces],
        "extent": _extent(shapes),
        "labels": [shapes.shade_label, shapes.arc_label, shapes.force_label],
    }


def _is_small(shapes: Shapes) -> bool:
    return shapes.positions.size + shapes.shade.size <= MOST_NUMBERS


def _drawn_elements(shapes: Shapes) -> dict[str, Any]:
    """Return the records of all elements, with colours."""
    strongest = np.sqrt((shapes.shade**2).sum(axis=1)).max(initial=0.0)
    return {
        "corners": shapes.corners.tolist(),
        "contact": shapes.contact.tolist(),
        "held": shapes.held.tolist(),
        "positions": packed(shapes.positions, "Float32Array"),
        "shade": packed(shapes.shade, "Float32Array"),
        "components": shapes.shade.shape[1],
        "strongest": float(strongest) or 1.0,
        "note": shapes.note,
    }


def _drawn_outline(shapes: Shapes) -> dict[str, Any]:
    """Return the records of the edges around the body, without colours."""
    edges = outline_of(shapes.corners)
    kept = np.unique(np.concatenate([edges.ravel(), shapes.contact, shapes.held]))
    count = shapes.corners.shape[0]
    return {
        "corners": np.searchsorted(kept, edges).tolist(),
        "contact": np.searchsorted(kept, shapes.contact).tolist(),
        "held": np.searchsorted(kept, shapes.held).tolist(),
        "positions": packed(shapes.positions[:, :, kept], "Float32Array"),
        "shade": packed([], "Float32Array"),
        "components": 0,
        "strongest": 1.0,
        "note": f"{shapes.note}; only the outline of {count} elements is shown",
    }


def outline_of(corners: Indices) -> Indices:
    """Return the edges that belong to a single element, shape (edges, 2), from all corners."""
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    ordered = np.sort(sides, axis=1)
    _, first, count = np.unique(ordered, axis=0, return_index=True, return_counts=True)
    edges: Indices = sides[first[count == 1]]
    return edges


def _curves(shapes: Shapes) -> Array:
    return np.stack([shapes.pressure, shapes.shear, shapes.bound], axis=1)


def _states(character: Any, shapes: Shapes, body: BodyPicture) -> list[int]:
    words = list(body.contact_states(character))
    if len(words) != len(shapes.contact) or not {*words} <= {*CONTACT_STATES}:
        raise InvalidSystemError(
            f"contact_states of {type(body).__name__} must return one of "
            f"{', '.join(CONTACT_STATES)} for each of {len(shapes.contact)} contact nodes"
        )
    return [CONTACT_STATES.index(word) for word in words]


def _extent(shapes: Shapes) -> list[float]:
    """Return left, right, bottom and top of body and obstacles, over all states."""
    body = shapes.positions.transpose(1, 0, 2).reshape(2, -1)
    every = np.hstack([body, *shapes.obstacles])
    return [float(some) for line in every for some in (line.min(), line.max())]
