"""Contact problems and Bratu's equation by AUTO-07p.

AUTO knows no kinks. It gets contact with min(0, x) as it is (eps = 0), or smoothed to
(x - sqrt(x^2 + eps^2)) / 2, and starts on the curve of what it gets. Seconds are those of a process
from start to end, with its files; :func:`idle` says what one takes that follows nothing. Its files
have eleven digits.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from curve import RUNS, Curve
from problem import contact, start
from scipy.optimize import root

from pwscont.basics.arrays import Array
from pwscont.bench.cases import Case
from pwscont.bench.truth.problems import Bratu

NAME = "AUTO-07p"
CONTACT = """
      subroutine func(ndim,u,icp,par,ijac,f,dfdu,dfdp)
      implicit none
      integer, intent(in) :: ndim, icp(*), ijac
      double precision, intent(in) :: u(ndim), par(*)
      double precision, intent(out) :: f(ndim)
      double precision, intent(inout) :: dfdu(ndim,ndim), dfdp(ndim,*)
      integer, parameter :: n = {n}, p = {p}
      double precision, parameter :: A(n,n) = reshape((/ {A} /), (/ n, n /))
      double precision, parameter :: Nt(n,p) = reshape((/ {N} /), (/ n, p /))
      double precision, parameter :: Tt(n,p) = reshape((/ {T} /), (/ n, p /))
      double precision, parameter :: f0(n) = (/ {f0} /), f1(n) = (/ {f1} /)
      double precision, parameter :: friction(p) = (/ {F} /), r = {r}
      double precision :: kappa, bound, y, low
      integer :: i
      f(1:n) = matmul(A, u(1:n)) - f0 - par(1)*f1
      do i = 1, p
        f(1:n) = f(1:n) - Nt(:,i)*u(n+i) - Tt(:,i)*u(n+p+i)
        kappa = low(u(n+i) - r*dot_product(Nt(:,i), u(1:n)))
        bound = friction(i)*kappa
        y = -bound + low(u(n+p+i) - r*dot_product(Tt(:,i), u(1:n)) + bound)
        f(n+i) = u(n+i) - kappa
        f(n+p+i) = u(n+p+i) - (bound - low(bound - y))
      end do
      end subroutine
      double precision function low(x)
      double precision, intent(in) :: x
      low = 0.5d0*(x - sqrt(x*x + {eps}**2))
      end function
"""
BRATU = """
      subroutine func(ndim,u,icp,par,ijac,f,dfdu,dfdp)
      implicit none
      integer, intent(in) :: ndim, icp(*), ijac
      double precision, intent(in) :: u(ndim), par(*)
      double precision, intent(out) :: f(ndim)
      double precision, intent(inout) :: dfdu(ndim,ndim), dfdp(ndim,*)
      integer :: i
      f = par(1)*exp(u)/dble(ndim + 1)**2 - 2d0*u
      f(2:) = f(2:) + u(:ndim-1)
      f(:ndim-1) = f(:ndim-1) + u(2:)
      if (ijac == 0) return
      dfdu = 0d0
      do i = 1, ndim
        dfdu(i,i) = par(1)*exp(u(i))/dble(ndim + 1)**2 - 2d0
        if (i > 1) dfdu(i,i-1) = 1d0
        if (i < ndim) dfdu(i,i+1) = 1d0
      end do
      dfdp(:,1) = exp(u)/dble(ndim + 1)**2
      end subroutine
"""
START = """
      subroutine stpnt(ndim,u,par,t)
      integer, intent(in) :: ndim
      double precision, intent(inout) :: u(ndim), par(*)
      double precision, intent(in) :: t
      par(1) = {lo}
      u = (/ {z} /)
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
NDIM={size}, IPS=1, IRS=0, ILP=1, ICP=[1], ISP=1, ISW=1, NPAR=2
NMX={most}, RL0={lo}, RL1={hi}, A0=0.0, A1=1e9, NPR=1, MXBF=0, IID=0
ITMX=8, ITNW={ITNW}, NWTN=3, JAC={jac}, EPSL=1e-9, EPSU=1e-9, EPSS=1e-7
DS={DS}, DSMIN=1e-9, DSMAX={DSMAX}, IADS=1
"""
SMOOTHINGS, MOST_POINTS, FOLD_LABEL = (0.0, 1e-6, 1e-4, 1e-2), 20000, 2
#: Longest steps in AUTO's own norm, and Newton iterations: more help at kinks, if they are allowed.
LONGEST, ITERATIONS = (0.1, 0.03, 0.01), (5, 20)
#: The solutions of Bratu's equation are longer by sqrt(31).
BRATU_LONGEST = (1.0, 0.1, 0.03, 0.01)


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """A program for AUTO, where it starts, and the settings that it is run at."""

    name: str
    source: str
    z: Array
    has_jacobian: bool
    settings: Sequence[Mapping[str, float]]


def home() -> Path | None:
    """Return where AUTO is, None if it or its compiler is not on this machine."""
    place = Path(os.environ.get("AUTO_DIR", "/usr/lib/auto-07p"))
    return place if (place / "lib").is_dir() and shutil.which("gfortran") else None


def curves(case: Case) -> list[Curve] | str:
    """Return all curves, or why there are none."""
    equations = _equations(case)
    if not equations:
        return "it has no adapter for this problem"
    auto = home()
    if auto is None:
        return "not on this machine"
    try:
        return list(_curves(auto, case, equations))
    except subprocess.CalledProcessError as error:
        return f"cannot be built: {error.stderr.decode().strip().splitlines()[-1:]}"


def _equations(case: Case) -> list[Equations]:
    if isinstance(case.system, Bratu):
        settings = [{"DSMAX": h, "DS": 0.1 * h, "ITNW": 5} for h in BRATU_LONGEST]
        return [Equations(NAME, BRATU, start(case)[:-1], True, settings)]
    problem = contact(case)
    return [_contact(problem, start(case), eps) for eps in SMOOTHINGS] if problem else []


def _contact(problem: Mapping[str, object], x: Array, eps: float) -> Equations:
    arrays = {name: _numbers(value) for name, value in problem.items()}
    n, p = len(np.array(problem["f0"])), len(np.array(problem["N"]))
    source = CONTACT.format(n=n, p=p, eps=_double(eps), **arrays)
    settings = [
        {"DSMAX": h, "DS": min(0.01, h), "ITNW": k, "eps": eps}
        for k, h in product(ITERATIONS, LONGEST)
    ]
    z = smoothed(problem, x, eps)
    return Equations(f"{NAME}, eps = {eps:g}", source, z, False, settings)


def smoothed(problem: Mapping[str, object], x: Array, eps: float) -> Array:
    """Return z of the smoothed equations at the alpha of ``x``, a true point next to it."""
    A, N, T, f0, f1, F = (np.array(problem[name]) for name in ("A", "N", "T", "f0", "f1", "F"))
    n, p, r = len(f0), len(F), float(str(problem["r"]))

    def low(y: Array) -> Array:
        return 0.5 * (y - np.sqrt(y * y + eps * eps))

    def residual(z: Array) -> Array:
        u, lam_nu, lam_t = np.split(z, (n, n + p))
        kappa = low(lam_nu - r * (N @ u))
        y = -F * kappa + low(lam_t - r * (T @ u) + F * kappa)
        friction = F * kappa - low(F * kappa - y)
        balance = A @ u - f0 - x[-1] * f1 - lam_nu @ N - lam_t @ T
        return np.concatenate([balance, lam_nu - kappa, lam_t - friction])

    return x[:-1] if eps == 0.0 else np.asarray(root(residual, x[:-1], tol=1e-13).x)


def _numbers(value: object) -> str:
    """Return all entries by rows: by columns of the transpose, as Fortran keeps it."""
    return ", &\n ".join(_double(entry) for entry in np.array(value, dtype=float).ravel())


def _double(value: float) -> str:
    return f"{value:.17e}".replace("e", "d")


def _curves(auto: Path, case: Case, several: Sequence[Equations]) -> Iterator[Curve]:
    """Yield the curves at all settings, compiling once per equations."""
    for equations in several:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            _compile(auto, folder, _program(case, equations))
            for setting in equations.settings:
                _prepare(folder, case, equations, setting)
                yield _measured(folder, equations.name, setting)


def _program(case: Case, equations: Equations) -> str:
    begin = START.format(lo=_double(case.interval[0]), z=_numbers(equations.z))
    return equations.source + begin


def _compile(auto: Path, folder: Path, source: str) -> None:
    (folder / "eq.f90").write_text(source)
    objects = sorted(map(str, (auto / "lib").glob("*.o")))
    command = ["gfortran", "-O2", "-fopenmp", "-o", "eq", "eq.f90", *objects]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)


def _prepare(
    folder: Path,
    case: Case,
    equations: Equations,
    setting: Mapping[str, float],
    most: int = MOST_POINTS,
) -> None:
    """Write the constants; the interval is longer below, where the start is."""
    lo, hi = case.interval
    numbers = {"size": case.system.size, "jac": int(equations.has_jacobian), "most": most}
    text = CONSTANTS.format(lo=lo - 0.02 * (hi - lo), hi=hi, **numbers, **setting)
    (folder / "fort.2").write_text(text)


def idle(case: Case) -> float | None:
    """Return the least seconds of a process that computes one step; None if AUTO is not here."""
    auto, several = home(), _equations(case)
    if auto is None or not several:
        return None
    equations = several[0]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _compile(auto, folder, _program(case, equations))
        _prepare(folder, case, equations, equations.settings[0], most=1)
        return min(_measured(folder, NAME, equations.settings[0]).seconds)


def _measured(folder: Path, name: str, setting: Mapping[str, float]) -> Curve:
    """Run several times; the curve is that of the last run, empty if it wrote none."""
    solutions = folder / "fort.8"
    seconds = []
    for _ in range(RUNS):
        solutions.unlink(missing_ok=True)
        seconds.append(_seconds(folder))
    points, folds = read(solutions.read_text() if solutions.exists() else "")
    words = f"DSMAX {setting['DSMAX']:g}, ITNW {setting['ITNW']:g}"
    return Curve(name, words, setting, tuple(seconds), points, folds)


def _seconds(folder: Path) -> float:
    begin = time.perf_counter()
    subprocess.run(["./eq"], cwd=folder, check=False, capture_output=True)
    return time.perf_counter() - begin


def read(text: str) -> tuple[Array, tuple[float, ...]]:
    """Return points (z, alpha) and folds of AUTO's file of solutions (fort.8), for equilibria.

    A solution is a line of integers (the third its type, the seventh to ninth the number of points
    and of their entries, and of lines that follow; the twelfth the number of parameters), then
    0, z and at the end the parameters.
    """
    lines, folds = iter(text.splitlines()), []
    points: list[list[float]] = []
    for line in lines:
        header = [int(word) for word in line.split()]
        entries = " ".join(next(lines) for _ in range(header[8])).split()
        point = [float(entry) for entry in (*entries[1 : header[7]], entries[-header[11]])]
        points.append(point)
        if abs(header[2]) % 10 == FOLD_LABEL:
            folds.append(point[-1])
    return np.array(points, ndmin=2), tuple(folds)
