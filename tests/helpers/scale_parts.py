"""What tests of large systems share."""

import sys
from pathlib import Path

from pwscont_coulomb.rows import rows_of_tests

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))


def plain(system):
    """Return the same system without elimination by hand."""
    system.algebra = None
    system._kappa1_rows, system._x_rows = rows_of_tests(system.body, system.r, False)
    system._known = None
    return system
