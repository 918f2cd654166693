"""Plane meshes from files of Gmsh and of the other formats that meshio reads."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from pwscont.foundation.errors import InvalidInputError
from pwscont_coulomb.elastic.libraries import loaded

#: Number of corners of the elements that a body may have.
CORNERS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad9": 4}
#: z coordinates that differ by more than this part of the mesh's size are not plane.
PLANE = 1e-12


def read_mesh(path: Path) -> Any:
    """Return a scikit-fem mesh; physical groups become boundaries and subdomains.

    Raises
    ------
    InvalidInputError
        If the file cannot be read, or holds no plane mesh of one kind of element.
    """
    meshio, bridge = loaded("meshio"), loaded("skfem.io.meshio")
    if not path.is_file():
        raise InvalidInputError(f"there is no mesh file {path}")
    try:
        with redirect_stdout(sys.stderr):  # some readers print, and ours is for the answer
            read = meshio.read(path)
        _refuse_other_cells(path, read)
        return bridge.from_meshio(_as_scikit_fem_expects(read))
    except InvalidInputError:
        raise
    except (Exception, SystemExit) as error:  # whatever a reader of a foreign format trips over
        raise InvalidInputError(f"cannot read a plane mesh from {path}: {error}") from error


def _refuse_other_cells(path: Path, read: Any) -> None:
    """Refuse what would be left out without a word: other cells, and a third dimension."""
    kinds = sorted({b.type for b in read.cells if not b.type.startswith(("line", "vertex"))})
    if len(kinds) != 1:
        raise InvalidInputError(
            f"{path} has cells of {len(kinds)} kinds ({', '.join(kinds) or 'no surface'}); a body "
            "needs elements of one kind"
        )
    if kinds[0] not in CORNERS:
        raise InvalidInputError(
            f"{path} has {kinds[0]} elements; a body needs {', '.join(CORNERS)} elements"
        )
    if read.points.shape[1] > 2 and np.ptp(read.points[:, 2]) > PLANE * np.ptp(read.points):
        raise InvalidInputError(f"the mesh in {path} is not plane: its z coordinates differ")


def _as_scikit_fem_expects(read: Any) -> Any:
    """Put corners before middle nodes, and give quadratic facets by their ends.

    scikit-fem numbers the corners of quadratic elements anew, by rank, and finds facets by the
    numbers of their ends: that fits only if the corners come first.
    """
    corners = [b.data[:, : CORNERS[b.type]].ravel() for b in read.cells if b.type in CORNERS]
    first = np.unique(np.concatenate(corners))
    order = np.concatenate([first, np.setdiff1d(np.arange(len(read.points)), first)])
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    read.points = read.points[order]
    for block in read.cells:
        block.data = number[block.data]
        if block.type == "line3":
            block.type, block.data = "line", block.data[:, :2]
    return read
