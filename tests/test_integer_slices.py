"""All solutions at one alpha, for families of small integers: tied, degenerate and singular."""

import math

import numpy as np
import pytest
from rational import SwitchedFamily
from sweeps import swept

from pwscont import enumerate_solutions


@pytest.mark.parametrize("seed", swept([*range(20), 162, 299, 843, 979], range(20, 800)))
@pytest.mark.sweep(8)
def test_complete_lists_are_complete(seed):
    """Infinitely many solutions are said: "but for 1 cell with infinitely many"."""
    family = SwitchedFamily(np.random.default_rng(seed))
    system = family.system(0.0)
    for alpha in (0.0, 0.5, 1.0, float(np.random.default_rng([seed, 1]).uniform(-1.0, 1.0))):
        expected, found = family.number_of_solutions(alpha, 0), enumerate_solutions(system, alpha)
        if expected is None or not found.guarantee.startswith("complete"):
            continue
        assert ("infinitely many" in found.guarantee) == (expected == math.inf)
        assert expected == math.inf or len(found) == expected
