"""Random histories of bodies with friction against brute force over all modes.

    python benchmarks/evolution_sweep.py [first] [last]

prints every history whose number of states, states or losses differ, and ends with a summary. There
must be no such history. Histories in which events accumulate are left out. Of the seeds from 0 to
10,000 one is left out, none is wrong or uncertain, 623 have branchings; the worst error is 1.6e-11.
"""

import sys
import time
from pathlib import Path

import numpy as np
from pwscont_coulomb import ContactBody, QuasiStaticCoulomb

from pwscont import LoadHistory, evolve

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "helpers"))
from evolution_truth import TooManyError, evolutions, random_problem

PLACES, BESIDE, SAME = 25, 1e-6, 1e-10
#: High friction and initial slip are frequent: then evolutions branch more often.
POWER, SLIPS = 0.5, 0.6


def difference(truth, evolution, seed):
    """Return in words how an evolution differs from the truth, and the largest error of a state."""
    lo, hi = evolution.interval
    events = [t for s in truth.segments for t in (s[0], s[2])]
    worst = 0.0
    for t in np.random.default_rng(seed).uniform(lo, hi, PLACES):
        if np.abs(np.array(events) - t).min(initial=np.inf) < BESIDE:
            continue
        expected, found = truth.states(t), [state.z for state in evolution.states(t)]
        if len(expected) != len(found):
            return f"t = {t:.6g}: {len(expected)} states, found {len(found)}", worst
        for z in expected:
            error = min(np.abs(z - other).max() for other in found) / max(1.0, np.abs(z).max())
            worst = max(worst, error)
            if error > SAME:
                return f"t = {t:.6g}: a state is off by {error:.3g}", worst
    if len(truth.losses) != len(evolution.losses()):
        return f"{len(truth.losses)} losses, found {len(evolution.losses())}", worst
    return "", worst


def main(first=0, last=1000):
    """Compare the histories of all seeds from ``first`` up to ``last``."""
    counts = dict.fromkeys(("histories", "wrong", "uncertain", "branching", "lost"), 0)
    worst, seconds = 0.0, 0.0
    for seed in range(first, last):
        problem = random_problem(seed, POWER, SLIPS)
        try:
            truth = evolutions(problem)
        except TooManyError:
            continue
        body = ContactBody(problem.A, problem.N, problem.T, problem.gap)
        history, begin = LoadHistory(problem.loads), time.perf_counter()
        system = QuasiStaticCoulomb(body, history, problem.F, problem.slip)
        evolution = evolve(system, history.interval)
        seconds += time.perf_counter() - begin
        words, error = difference(truth, evolution, seed)
        worst = max(worst, error)
        counts["histories"] += 1
        counts["uncertain"] += not evolution.is_complete
        counts["branching"] += truth.branchings > 0
        counts["lost"] += bool(truth.losses)
        if words:
            counts["wrong"] += 1
            print(f"seed {seed}: {words}; {evolution.guarantee}")
    print(", ".join(f"{number} {word}" for word, number in counts.items()))
    print(f"worst error of a state {worst:.2g}; {seconds:.1f} s in evolve")
    return counts["wrong"]


if __name__ == "__main__":
    sys.exit(bool(main(*map(int, sys.argv[1:3]))))
