"""Run a script on rank 0 while the other ranks serve :class:`~pwscont_coulomb.elastic.Mumps`.

``mpiexec -n 4 python -m pwscont_coulomb.mpi SCRIPT [ARGUMENTS ...]``. The script is an ordinary
script, the same as for a single process.
"""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

from pwscont_coulomb.elastic.ranks import hosting, mpi, serve


def main() -> None:
    """Run the script, or serve."""
    if len(sys.argv) < 2:
        sys.exit("usage: mpiexec -n RANKS python -m pwscont_coulomb.mpi SCRIPT [ARGUMENTS ...]")
    comm = mpi().COMM_WORLD
    if comm.rank:
        serve(comm)
    else:
        with hosting(comm):
            _run(sys.argv[1:])


def _run(command: list[str]) -> None:
    """Run a script as ``python SCRIPT`` does, with the script's folder first on the path."""
    sys.argv = command
    sys.path.insert(0, str(Path(command[0]).resolve().parent))
    runpy.run_path(command[0], run_name="__main__")


if __name__ == "__main__":
    main()
