"""Matrices in files of the format Matrix Market."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np
import scipy.sparse as sp
from scipy.io import mmread

from pwscont import InvalidInputError
from pwscont.extending import Matrix

#: A word that is no number, as 1.0D+3 of Fortran or 1,5, in a line that is no comment. Readers take
#: the digits before, and skip the rest.
NO_NUMBER = re.compile(rb"^[^%\n]*?([0-9eE+.\-]*[^%\s0-9eE+.\-]\S*)", re.MULTILINE)
#: What else lines of numbers are made of.
NUMBERS = b"0123456789eE+-. \t\r\n"
#: Number of bytes of a file that are looked at together.
TOGETHER = 2**24


def read_matrices(path: str | Path) -> dict[str, Matrix]:
    """Read the matrices of a body from ``.mtx`` files (Matrix Market).

    Parameters
    ----------
    path : str or Path
        A folder, of which all files ``NAME.mtx`` are read; or one file.

    Returns
    -------
    dict of str to scipy.sparse or ndarray
        By the names of the files. Sparse matrices are in CSR format; a dense matrix of one column,
        such as a load, is a vector.

    Raises
    ------
    InvalidInputError
        If there is no such file, or a file is no real matrix in this format.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import scipy.sparse as sp
    >>> from scipy.io import mmwrite
    >>> from pwscont_coulomb import ContactBody, read_matrices
    >>> with TemporaryDirectory() as folder:
    ...     mmwrite(Path(folder, "A.mtx"), sp.csr_matrix([[2.0, -1.0], [-1.0, 2.0]]))
    ...     mmwrite(Path(folder, "N.mtx"), sp.csr_matrix([[1.0, 0.0]]))
    ...     mmwrite(Path(folder, "T.mtx"), sp.csr_matrix([[0.0, 1.0]]))
    ...     matrices = read_matrices(folder)
    >>> ContactBody(**matrices)
    ContactBody(2 displacements, 1 contact node, sparse)
    """
    place = Path(path)
    files = sorted(place.glob("*.mtx")) if place.is_dir() else [place]
    if not files:
        raise InvalidInputError(f"there is no file with the ending .mtx in {place}")
    return {file.stem: _matrix(file) for file in files}


def _matrix(file: Path) -> Matrix:
    try:
        with catch_warnings():  # of the kind of sparse matrix: either kind is fine
            simplefilter("ignore", DeprecationWarning)
            found: Any = mmread(file)
    except (OSError, ValueError, TypeError, EOFError) as error:
        raise InvalidInputError(f"cannot read {file} as a matrix: {error}") from error
    if file.suffix == ".mtx" and (word := _no_number(file)):
        raise InvalidInputError(
            f"{file} holds {word}, which is no number in this format: write E for D, as in 1.0E+3, "
            "and a point for a comma"
        )
    if np.iscomplexobj(found.data if sp.issparse(found) else found):
        raise InvalidInputError(f"{file} holds complex numbers; stiffness and loads are real")
    if sp.issparse(found):
        return sp.csr_matrix(found, dtype=float)
    array = np.asarray(found, dtype=float)
    return array.ravel() if array.shape[1] == 1 else array


def _no_number(file: Path) -> str:
    """Return the first word of a file that would be read in part, empty where there is none."""
    with file.open("rb") as opened:
        while opened.readline().startswith(b"%"):
            pass  # the comments at the top, and the line of sizes after these
        while part := opened.read(TOGETHER) + opened.readline():
            if part.translate(None, NUMBERS) and (found := NO_NUMBER.search(part)):
                return found[1].decode(errors="replace")
    return ""
