"""Plane meshes from files of Gmsh and of the other formats that meshio reads."""

from __future__ import annotations

import io
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from pwscont import InvalidInputError, MissingPackageError
from pwscont_coulomb.elastic.libraries import loaded
from pwscont_coulomb.elastic.repetition import ONCE, copies, in_words, repeated

#: The kinds of elements that a body may have -> number of corners.
CORNERS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad9": 4}
#: Largest spread of z coordinates of a plane mesh, as a part of the mesh's size: rounding.
PLANE = 1e-12
#: The names under which meshio has the number of each cell's group, zero for no group.
NUMBERS = ("gmsh:physical", "medit:ref", "cell_tags")


def read_mesh(path: Path) -> Any:
    """Return a scikit-fem mesh; physical groups become boundaries and subdomains.

    A group without a name gets the number of the group as name.

    Raises
    ------
    InvalidInputError
        If the file cannot be read, or holds no plane mesh of a single kind of element.
    MissingPackageError
        If meshio needs another package for this format.
    """
    loaded("meshio"), loaded("skfem.io.meshio")
    if not path.is_file():
        raise InvalidInputError(f"there is no mesh file {path}")
    if not path.stat().st_size:
        raise InvalidInputError(f"the mesh file {path} is empty")
    try:
        read = _read(path)
        _refuse_other_cells(path, read)
        _name_groups(path, read)
        _refuse_repeated_cells(path, read)
        mesh = loaded("skfem.io.meshio").from_meshio(_as_scikit_fem_expects(read))
        _refuse_lost_facets(path, read, mesh)
        return mesh
    except (InvalidInputError, MissingPackageError):
        raise
    except Exception as error:  # readers of foreign formats fail in many ways
        cause = f"KeyError: {error}" if isinstance(error, KeyError) else error
        raise InvalidInputError(f"cannot read a plane mesh from {path}: {cause}") from error


def _read(path: Path) -> Any:
    """Return what meshio reads; catch the printed reasons of readers that fail."""
    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            read = loaded("meshio").read(path)
    except ImportError as error:
        raise MissingPackageError(
            f"meshio needs {error.name} to read {path}: pip install {error.name}"
        ) from error
    except SystemExit as error:
        cause = " ".join(said.getvalue().split()) or "meshio does not say why"
        raise InvalidInputError(f"cannot read a plane mesh from {path}: {cause}") from error
    sys.stderr.write(said.getvalue())  # warnings; standard output is for the answer
    return read


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


def _name_groups(path: Path, read: Any) -> None:
    """Name cells by physical groups alone; some formats have a number for each cell.

    Groups of lines and of surfaces may have the same number: the dimension makes the difference.
    """
    read.cell_sets = {k: v for k, v in read.cell_sets.items() if not k.startswith("gmsh:")}
    numbers = [read.cell_data.pop(key) for key in NUMBERS if key in read.cell_data]
    known = {(number, dim): [name] for name, (number, dim) in read.field_data.items()}
    known |= {(n, d): names for n, names in getattr(read, "cell_tags", {}).items() for d in (1, 2)}
    groups: dict[str, list[Any]] = {}
    for k, tags in ((k, tags) for blocks in numbers for k, tags in enumerate(blocks)):
        for tag in np.unique(tags[tags != 0]).tolist():
            names = known.get((tag, read.cells[k].dim))
            if names is not None and read.cell_sets:
                continue  # meshio knows the named groups, with cells that are in several groups
            if names is None and str(tag) in read.field_data:
                raise InvalidInputError(f"group {tag} in {path} has no name; another one is {tag}")
            for name in names or [str(tag)]:
                parts = groups.setdefault(name, [np.zeros(0, dtype=int) for _ in read.cells])
                parts[k] = np.union1d(parts[k], np.flatnonzero(tags == tag))
    read.cell_sets |= groups


def _refuse_repeated_cells(path: Path, read: Any) -> None:
    """Refuse cells that are listed twice; scikit-fem keeps a single group of a line."""
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
    """Refuse named lines that are edges of no element, which scikit-fem would leave out."""
    lines = [k for k, block in enumerate(read.cells) if block.type == "line"]
    for name, parts in read.cell_sets.items():
        given = sum(len(parts[k]) for k in lines)
        found = len((mesh.boundaries or {}).get(name, ()))
        if given != found:
            raise InvalidInputError(
                f"{given - found} of {given} lines of {name!r} in {path} are edges of no element"
            )


def _as_scikit_fem_expects(read: Any) -> Any:
    """Put corners before middle nodes, and describe quadratic facets by end nodes.

    scikit-fem numbers the corners of quadratic elements anew, by rank, and finds facets by the
    numbers of end nodes: the numbers fit only if the corners come first.
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
