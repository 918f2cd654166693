"""Fig. 7 of the paper by AUTO-07p: one contact node, f = (0.25, alpha), F = 4.

AUTO knows no kinks. It gets the equations with min(0, x) as they are (eps = 0), or smoothed to
(x - sqrt(x^2 + eps^2)) / 2. True folds: alpha = -0.5 and -1; the curve ends at alpha = 2.
"""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

EQUATIONS = """
      subroutine func(ndim,u,icp,par,ijac,f,dfdu,dfdp)
      implicit none
      integer, intent(in) :: ndim, icp(*), ijac
      double precision, intent(in) :: u(ndim), par(*)
      double precision, intent(out) :: f(ndim)
      double precision, intent(inout) :: dfdu(ndim,ndim), dfdp(ndim,*)
      double precision :: kappa, bound, y, low
      kappa = low(u(3) - u(1), par(2))
      bound = 4d0*kappa
      y = -bound + low(u(4) - u(2) + bound, par(2))
      f(1) = 2d0*u(1) - u(2) - 0.25d0 - u(3)
      f(2) = -u(1) + 2d0*u(2) - par(1) - u(4)
      f(3) = u(3) - kappa
      f(4) = u(4) - (bound - low(bound - y, par(2)))
      end subroutine
      double precision function low(x, eps)
      double precision, intent(in) :: x, eps
      low = 0.5d0*(x - sqrt(x*x + eps*eps))
      end function
      subroutine stpnt(ndim,u,par,t)
      integer, intent(in) :: ndim
      double precision, intent(inout) :: u(ndim), par(*)
      double precision, intent(in) :: t
      par(1) = -2d0
      par(2) = EPS
      u = (/ -0.5d0, -1.25d0, 0d0, 0d0 /)
      end subroutine
      subroutine bcnd
      end subroutine
      subroutine icnd
      end subroutine
      subroutine fopt
      end subroutine
      subroutine pvls
      end subroutine
"""
CONSTANTS = """
NDIM=4, IPS=1, IRS=0, ILP=1, ICP=[1], ISP=1, ISW=1, NPAR=2
NMX=20000, RL0=-2.1, RL1=2.0, A0=0.0, A1=1e6, NPR=20000, MXBF=0, IID=0
ITMX=8, ITNW={iterations}, NWTN=3, JAC=0, EPSL=1e-9, EPSU=1e-9, EPSS=1e-7
DS=0.01, DSMIN=1e-9, DSMAX={largest}, IADS=1
"""
SMOOTHINGS, LONGEST, ITERATIONS = (0.0, 1e-6, 1e-4, 1e-2), (0.1, 0.01, 0.001), (5, 20)
FOLDS, END, FOLD_LABEL = (-0.5, -1.0), 2.0, 2
#: Smoothing moves folds; so near to the true place counts as found.
NEAR = 0.05


@dataclass(frozen=True)
class Run:
    """One setting: where the run ended, its folds and what it took (start-up included)."""

    eps: float
    largest: float
    iterations: int
    seconds: float
    points: int
    last: float
    folds: tuple[float, ...]

    @property
    def whole(self) -> bool:
        """Whether it reached the end of the curve with both folds, and none elsewhere."""
        near = all(any(abs(a - b) < NEAR for b in FOLDS) for a in self.folds)
        return near and self.off < NEAR and self.last >= END

    @property
    def off(self) -> float:
        """How far the nearest reported folds are from the true ones."""
        return max(min((abs(a - b) for a in self.folds), default=math.inf) for b in FOLDS)


def home() -> Path | None:
    """Return where AUTO is, None if it or its compiler is not on this machine."""
    place = Path(os.environ.get("AUTO_DIR", "/usr/lib/auto-07p"))
    return place if (place / "lib").is_dir() and shutil.which("gfortran") else None


def runs(auto: Path) -> Iterator[Run]:
    """Yield all settings, compiling once per smoothing."""
    for eps in SMOOTHINGS:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            _compile(auto, folder, eps)
            for largest, iterations in product(LONGEST, ITERATIONS):
                yield _run(folder, eps, largest, iterations)


def _compile(auto: Path, folder: Path, eps: float) -> None:
    (folder / "eq.f90").write_text(EQUATIONS.replace("EPS", f"{eps:.17e}".replace("e", "d")))
    objects = sorted(map(str, (auto / "lib").glob("*.o")))
    command = ["gfortran", "-O2", "-fopenmp", "-o", "eq", "eq.f90", *objects]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)


def _run(folder: Path, eps: float, largest: float, iterations: int) -> Run:
    (folder / "fort.2").write_text(CONSTANTS.format(largest=largest, iterations=iterations))
    begin = time.perf_counter()
    subprocess.run(["./eq"], cwd=folder, check=False, capture_output=True, timeout=120)
    seconds = time.perf_counter() - begin
    rows = [line.split() for line in (folder / "fort.7").read_text().splitlines()]
    rows = [row for row in rows if row and row[0] != "0"]
    folds = tuple(float(row[4]) for row in rows if abs(int(row[2])) == FOLD_LABEL)
    return Run(eps, largest, iterations, seconds, len(rows), float(rows[-1][4]), folds)


def report() -> str:
    """Return what AUTO did at each smoothing."""
    auto = home()
    if auto is None:
        return "AUTO-07p: not on this machine"
    found, lines = list(runs(auto)), ["AUTO-07p, fig7:"]
    for eps in SMOOTHINGS:
        mine = [run for run in found if run.eps == eps]
        whole = [run for run in mine if run.whole]
        text = f"  eps = {eps:g}: {len(whole)} of {len(mine)} settings traced the whole curve"
        if whole:
            best = min(whole, key=lambda run: run.points)
            text += (
                f"; fewest points {best.points}, {1e3 * best.seconds:.1f} ms with start-up, "
                f"folds off by {best.off:.1e}"
            )
        lines.append(text)
    return "\n".join(lines)


if __name__ == "__main__":
    print(report())
