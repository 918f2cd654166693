"""Plane meshes from files of Gmsh and of the other formats that meshio reads."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from pwscont import InvalidInputError
from pwscont_coulomb.elastic.libraries import loaded
from pwscont_coulomb.elastic.repetition import ONCE, copies, in_words, repeated

#: The kinds of elements that a body may have, with the number of their corners.
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
        with redirect_stdout(sys.stderr):  # some readers print; standard output is for the answer
            read = meshio.read(path)
        _refuse_other_cells(path, read)
        _name_groups(read)
        _refuse_repeated_cells(path, read)
        mesh = bridge.from_meshio(_as_scikit_fem_expects(read))
        _refuse_lost_facets(path, read, mesh)
        return mesh
    except InvalidInputError:
        raise
    except (Exception, SystemExit) as error:  # readers of foreign formats fail in many ways
        raise InvalidInputError(f"cannot read a plane mesh from {path}: {error}") from error


def _refuse_other_cells(path: Path, read: Any) -> None:
    """Refuse other cells and a third dimension, which would be left out silently."""
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


def _name_groups(read: Any) -> None:
    """Name cells by physical groups alone; those of MSH 2.2 are numbers, one for each cell.

    Groups of lines and of surfaces may have the same number: their dimensions tell them apart.
    """
    read.cell_sets = {k: v for k, v in read.cell_sets.items() if not k.startswith("gmsh:")}
    numbers = read.cell_data.pop("gmsh:physical", None)
    if numbers is None or read.cell_sets:
        return
    for name, (number, dimension) in read.field_data.items():
        read.cell_sets[name] = [
            np.flatnonzero((tags == number) & (block.dim == dimension))
            for block, tags in zip(read.cells, numbers, strict=True)
        ]


def _refuse_repeated_cells(path: Path, read: Any) -> None:
    """Refuse cells that are listed twice; of lines, scikit-fem keeps one group only."""
    for kind in sorted({block.type for block in read.cells} - {"vertex"}):
        corners = read.cells_dict[kind][:, : CORNERS.get(kind, 2)].T
        again = repeated(corners)
        if len(again):
            same, sets = copies(corners, again[0]), read.cell_sets_dict
            names = [k for k, part in sets.items() if np.isin(same, part.get(kind, ())).any()]
            x, y = read.points[corners[:, again[0]], :2].mean(axis=0)
            raise InvalidInputError(
                f"{path} lists {len(again)} of its {corners.shape[1]} {kind} cells again"
                f"{in_words(names)}, the first at ({x:.6g}, {y:.6g}); {ONCE}"
            )


def _refuse_lost_facets(path: Path, read: Any, mesh: Any) -> None:
    """Refuse named lines that are edges of no element: scikit-fem would leave them out."""
    lines = [k for k, block in enumerate(read.cells) if block.type == "line"]
    for name, parts in read.cell_sets.items():
        given = sum(len(parts[k]) for k in lines)
        found = len((mesh.boundaries or {}).get(name, ()))
        if given != found:
            raise InvalidInputError(
                f"{given - found} of {given} lines of {name!r} in {path} are edges of no element"
            )


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
