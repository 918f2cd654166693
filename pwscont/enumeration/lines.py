"""The lines of all cells of a piecewise-linear system, and where each line leaves its closed cell.

With alpha as a further unknown, the solutions in a regular cell are a line, of which the
inequalities of the cell leave a segment. The ends of all segments are the transitions of all
branches, and the solutions at both ends of the interval.
"""

from __future__ import annotations

import numpy as np

from pwscont.basics.arrays import Array, Indices, own_dense
from pwscont.basics.rounding import GUARD
from pwscont.curve.metric import Metric
from pwscont.enumeration.choices import SLACK, Choices
from pwscont.enumeration.options import Problem, affine, aside, problem_of
from pwscont.system.box import Box
from pwscont.system.promises import refuse_bent_tests
from pwscont.system.system import PiecewiseLinearSystem

#: In place of a test: the lower end of the interval, and an inequality of no further interest.
LOWER_END, OTHER = -1, -2


def problem_with_alpha(system: PiecewiseLinearSystem, metric: Metric) -> Problem | None:
    """Return the problem for the unknowns (z, alpha - lo), None for a problem without solution.

    The inequality alpha >= lo is the last of the lower bounds.
    """
    (lo, hi), scale, box = metric.interval, metric.scale[:-1], Box.of(system)
    n = system.size
    x, dx = np.append(np.zeros(n), lo), aside(scale)
    dx[-1] = hi - lo
    tests = np.array(system.test_functions(x[:-1], lo), dtype=float)
    K = own_dense(system.test_jacobian(x[:-1], lo))
    refuse_bent_tests(system, x, dx, tests, K)
    slices = list(affine(system, lo, dx, len(tests)))
    least, most = np.append(box.lower, 0.0), np.append(box.upper, hi - lo)
    unit, below, above = np.eye(n + 1), np.isfinite(least), np.isfinite(most)
    within = np.vstack([unit[below], -unit[above]]), np.append(-least[below], most[above])
    return problem_of(system, slices, (K, tests), within, np.append(scale, hi - lo))


def ends_of_lines(problem: Problem, choices: Choices, lower_end: int) -> tuple[Choices, Indices]:
    """Return the ends of the lines in the cells of choices, and the test that vanishes at each.

    Parameters
    ----------
    problem : Problem
        As from :func:`problem_with_alpha`.
    choices : Choices
        With a single free direction.
    lower_end : int
        The inequality of the problem that says alpha >= lo.

    Returns
    -------
    Choices, ndarray of int
        Ends that lie in the closed cells, or nearly. For an end of the interval, and for a bound of
        an unknown, the test is :data:`LOWER_END` or :data:`OTHER`.
    """
    values, slopes, tests = _inequalities(problem, choices, lower_end)
    level = np.abs(slopes) <= np.minimum(GUARD * choices.rounding, SLACK)[:, np.newaxis]
    slack, divisors = choices.slack[:, np.newaxis], np.where(level, 1.0, slopes)
    relaxed, zeros = -(values + slack) / divisors, -values / divisors
    begin = np.where(~level & (slopes > 0.0), relaxed, -np.inf).max(axis=1, keepdims=True)
    end = np.where(~level & (slopes < 0.0), relaxed, np.inf).min(axis=1, keepdims=True)
    is_end = ~level & (begin <= zeros) & (zeros <= end)
    is_end &= (~level | (values >= -slack)).all(axis=1, keepdims=True)
    which, inequality = np.nonzero(is_end)
    s = zeros[which, inequality, np.newaxis]
    starts = choices.starts[which] + s * choices.directions[which, :, 0]
    none = np.zeros((*starts.shape, 0))
    ends = Choices(choices.picks[:, which], starts, none, choices.growth[which])
    return ends, tests[which, inequality]


def _inequalities(
    problem: Problem, choices: Choices, lower_end: int
) -> tuple[Array, Array, Indices]:
    """Return values at the starts of lines, slopes, and tests, of all inequalities of each cell.

    Options with fewer inequalities than others get some that always hold.
    """
    starts, directions = choices.starts, choices.directions[..., 0]
    others = np.full((len(choices), len(problem.b)), OTHER)
    others[:, lower_end] = LOWER_END
    values, slopes, tests = [starts @ problem.A.T + problem.b], [directions @ problem.A.T], [others]
    for options, picks in zip(problem.blocks, choices.picks, strict=True):
        shape = len(options), max(len(option.g) for option in options)
        G, g = np.zeros((*shape, problem.dimension)), np.ones(shape)
        names = np.full(shape, OTHER)
        for k, option in enumerate(options):
            t = len(option.g)
            G[k, :t], g[k, :t], names[k, :t] = option.G, option.g, option.bounding
        values.append((G[picks] @ starts[..., np.newaxis])[..., 0] + g[picks])
        slopes.append((G[picks] @ directions[..., np.newaxis])[..., 0])
        tests.append(names[picks])
    return np.hstack(values), np.hstack(slopes), np.hstack(tests)
