"""The curve of a contact problem by GetFEM's continuation, as a program of its own.

    /usr/bin/python3 -I getfem.py < problem.json > answer.json

The problem is {"A", "N", "T", "F", "r", "f0", "f1", "start", "interval", "settings", "runs"}, with
z = (u, lam_nu, lam_t) at the start; a matrix is its rows, or {"shape", "entries"} with entries
[row, column, value]. The answer is {"curves": [{"seconds", "points", "folds"}]}, a curve for each
of the settings, or {"missing"} where GetFEM is not on the machine. Run isolated
(-I): this file has the name of the package that it imports.

GetFEM gets the stiffness matrix A as it is, the load as a datum of the model between f0 (gamma = 0)
and f0 + f1 (gamma = 1), so that its gamma is alpha, and its contact brick with friction and
augmented multipliers. For the paper's one node, A is that of one linear triangle in plane strain
with right angle at that node, legs of length one and both Lame coefficients one.
"""

import json
import os
import sys
import time

#: No run takes more steps.
MOST_STEPS = 20000


class Curve:
    """A model of GetFEM's, and its continuation at one setting."""

    def __init__(self, np, getfem, given):
        self.np, self.getfem, self.given = np, getfem, given
        # kept, because GetFEM frees what Python drops while its model still uses it
        self.segment = getfem.Mesh("cartesian", np.array([0.0, 1.0]))
        self.integral = getfem.MeshIm(self.segment, getfem.Integ("IM_GAUSS1D(1)"))
        self.model, self.size = self._model(), len(given["start"]) - 1

    def _model(self):
        given, model, array = self.given, self.getfem.Model("real"), self.np.array
        p, f0, f1 = len(given["F"]), array(given["f0"]), array(given["f1"])
        for name, length in {"u": len(f0), "lam_nu": p, "lam_t": p}.items():
            model.add_variable(name, length)
        data = {"alpha": [0.0], "first": f0, "last": f0 + f1, "load": f0}
        data |= {"F": given["F"], "r": [given["r"]], "gap": [0.0] * p, "weights": [1.0] * p}
        for name, value in data.items():
            model.add_initialized_data(name, array(value))
        model.add_explicit_matrix("u", "u", self._sparse(given["A"]))
        model.add_linear_term(self.integral, "-load.Test_u")  # of a constant, over length one
        N, T = self._sparse(given["N"]), self._sparse(given["T"])
        names = ("u", "lam_nu", "lam_t", "r", N, T, "F", "gap", "weights")
        model.add_basic_contact_brick(*names, 1)
        return model

    def _sparse(self, given):
        rows, columns, entries = _entries(given)
        matrix = self.getfem.Spmat("empty", rows, columns)
        for i, j, entry in entries:
            matrix.add(i, j, entry)
        return matrix

    def order(self):
        """Return where GetFEM keeps u, lam_nu and lam_t."""
        names = ("u", "lam_nu", "lam_t")
        parts = (self.model.interval_of_variable(name) for name in names)
        return self.np.concatenate([first + self.np.arange(length) for first, length in parts])

    def structure(self, setting):
        """Return GetFEM's own object for one setting; limit points are detected."""
        options = [entry for pair in setting.items() for entry in pair]
        names = ("alpha", "first", "last", "load")
        asked = ("singularities", 1, "non-smooth")
        return self.getfem.ContStruct(self.model, *names, 1.0 / self.size, *options, *asked)

    def follow(self, setting):
        """Return the points (z, alpha) up to the end of the interval, and folds in alpha."""
        order, S, (lo, hi) = self.order(), self.structure(setting), self.given["interval"]
        *start, alpha = self.given["start"]
        x, points, folds = self.np.zeros(self.size), [self.given["start"]], []
        x[order] = start
        tangent, slope, h = S.init_Moore_Penrose_continuation(x, alpha, 1.0)
        while lo <= points[-1][-1] <= hi and len(points) < MOST_STEPS:
            step = S.Moore_Penrose_continuation(x, alpha, tangent, slope, h)
            x, alpha, tangent, slope, h = step[:5]
            if h == 0:
                break  # GetFEM: "Continuation has failed"
            points.append([*x[order].tolist(), alpha])
            if step[-1] == "limit point":
                folds.append(_farther(points, slope))
        return points, folds

    def measure(self, setting):
        """Return the curve and the seconds of each run, after one to warm up."""
        points, folds = self.follow(setting)
        seconds = []
        for _ in range(self.given["runs"]):
            begin = time.perf_counter()
            self.follow(setting)
            seconds.append(time.perf_counter() - begin)
        return {"seconds": seconds, "points": points, "folds": folds}


def _entries(given):
    """Return the size of a matrix and its entries, from rows or from {"shape", "entries"}."""
    if isinstance(given, dict):
        return *given["shape"], given["entries"]
    found = [(i, j, x) for i, row in enumerate(given) for j, x in enumerate(row) if x]
    return len(given), len(given[0]), found


def _farther(points, slope):
    """Return the alpha of a fold between the last two points: that of the one nearer to it.

    GetFEM names the step and does not locate the fold.
    """
    last = [point[-1] for point in points[-2:]]
    return max(last) if slope < 0.0 else min(last)


def main():
    """Follow the curve of the problem on standard input."""
    answer = os.dup(1)
    os.dup2(2, 1)  # GetFEM writes messages to standard output
    result = {"missing": "not on this machine"}
    try:
        import getfem  # noqa: PLC0415  the system's Python may have neither
        import numpy as np  # noqa: PLC0415
    except ImportError:
        pass
    else:
        given = json.load(sys.stdin)
        getfem.util_trace_level(0)
        getfem.util_warning_level(0)
        curve = Curve(np, getfem, given)
        result = {"curves": [curve.measure(setting) for setting in given["settings"]]}
    os.write(answer, (json.dumps(result) + "\n").encode())


if __name__ == "__main__":
    main()
