"""GetFEM's continuation on contact problems with a straight load path.

Its authors' settings are those of their example of a vee-shaped body in GetFEM's own distribution;
they differ from the defaults in tolerances, steps and the least cosine between successive tangents
(min_cos).
"""

from __future__ import annotations

import numpy as np
from ask import ask
from curve import RUNS, Curve
from problem import contact, start

from pwscont.bench.cases import Case

NAME = "GetFEM"
AUTHORS = {
    "h_init": 5e-4,
    "h_min": 5e-7,
    "max_iter": 5,
    "thr_iter": 4,
    "max_res": 5e-12,
    "max_diff": 5e-12,
    "max_res_solve": 1e-12,
}
#: By name of the line. The default of min_cos is 0.9; the authors' is 0.99999, and h_max 0.1.
SETTINGS = {
    "GetFEM, defaults but min_cos": [{"min_cos": c} for c in (0.5, 0.8, 0.9, 0.91, 0.95, 0.99)],
    "GetFEM, its authors' settings": [
        AUTHORS | {"min_cos": c, "h_max": h}
        for c, h in ((0.9, 0.1), (0.99999, 0.1), (0.99999, 0.03), (0.99999, 0.01))
    ],
}
WORDS = ("min_cos", "h_max")


def curves(case: Case) -> list[Curve] | str:
    """Return all curves, or why there are none."""
    problem = contact(case)
    if problem is None:
        return "it has no adapter for this problem"
    settings = [(name, setting) for name, several in SETTINGS.items() for setting in several]
    limits = {"interval": case.interval, "runs": RUNS}
    asked = {"start": start(case).tolist(), "settings": [setting for _, setting in settings]}
    answer = ask("getfem.py", problem | limits | asked)
    if "missing" in answer:
        return str(answer["missing"])
    pairs = zip(settings, answer["curves"], strict=True)
    return [_curve(name, setting, found) for (name, setting), found in pairs]


def _curve(name: str, setting: dict[str, float], found: dict[str, list[float]]) -> Curve:
    words = ", ".join(f"{word} {setting[word]:g}" for word in WORDS if word in setting)
    points, seconds = np.array(found["points"]), tuple(found["seconds"])
    return Curve(name, words, setting, seconds, points, tuple(found["folds"]))
