"""Other programs in the bench: their curves become rows, and what is not there is said.

No peer is needed here: curves are made up from the true answer.
"""

import importlib.util
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pwscont.bench.cases import load_case
from pwscont.bench.picture import draw
from pwscont.bench.report import as_dict, as_text, machine

PEERS = Path(__file__).parents[1] / "benchmarks" / "peers"
sys.path.append(str(PEERS))

import ask  # noqa: E402
import auto07p  # noqa: E402
import by_getfem  # noqa: E402
import report  # noqa: E402
from curve import NEAR, Curve, row_of, within  # noqa: E402
from problem import contact, start  # noqa: E402

ROUNDING = 1e-14
FOLDS = (-0.5, -1.0)
#: Ends of the pieces of fig7 in the order of the curve, (u_nu, u_t, lam_nu, lam_t, alpha).
CORNERS = np.array(
    [
        [-0.5, -1.25, 0.0, 0.0, -2.0],
        [0.0, -0.25, 0.0, 0.0, -0.5],
        [0.0, 0.0, -0.25, 1.0, -1.0],
        [0.0, 0.0, -0.25, -1.0, 1.0],
        [0.0, 1 / 6, -5 / 12, -5 / 3, 2.0],
    ]
)


@pytest.fixture(scope="module")
def fig7():
    return load_case("fig7")


def made_up(points, folds=FOLDS, peer="peer"):
    setting = {"tolerance": 1e-6}
    return Curve(peer, "tolerance 1e-06", setting, (0.2, 0.1, 0.4), np.array(points), folds)


# -- rows -----------------------------------------------------------------------------------------


def test_the_true_curve_is_right(fig7):
    row = row_of(fig7, made_up(CORNERS))
    assert not row.wrong
    assert row.errors.branch_max < ROUNDING
    assert row.errors.points_max < ROUNDING
    assert row.errors.folds == 0.0
    assert np.isnan(row.errors.transitions)  # no peer reports them
    assert (row.median, row.points, row.calls) == (0.2, 5, {})


def test_a_shift_is_the_error(fig7):
    """All points displaced in one unknown that is constant or off the curve nowhere else."""
    shifted = CORNERS.copy()
    shifted[:, 2] += 1e-3  # lam_nu, off every piece but the last
    row = row_of(fig7, made_up(shifted, (-0.5004, -1.0)))
    assert not row.wrong
    assert row.errors.points_max == pytest.approx(1e-3 / fig7.truth.scale[2], rel=0.3)
    assert row.errors.folds == pytest.approx(1e-4)  # of an interval of length 4


def test_an_end_beyond_the_interval_is_cut(fig7):
    beyond = CORNERS.copy()
    beyond[-1] += 0.1 * (CORNERS[-1] - CORNERS[-2])
    row = row_of(fig7, made_up(beyond))
    assert not row.wrong
    assert row.errors.branch_max < ROUNDING
    np.testing.assert_allclose(within(beyond, (-2.0, 2.0))[-1], CORNERS[-1], atol=ROUNDING)


def test_a_start_before_the_interval_is_cut():
    np.testing.assert_allclose(
        within(CORNERS, (-1.25, 1.5))[[0, -1], -1], [-1.25, 1.5], atol=ROUNDING
    )
    assert len(within(CORNERS, (-1.25, 1.5))) == 5
    assert within(CORNERS[:1], (3.0, 4.0)).shape == (0, 5)


@pytest.mark.parametrize(
    ("points", "folds", "message"),
    [
        (CORNERS[:3], FOLDS, "stopped at alpha = -1"),
        (CORNERS[[0, 1, 3, 4]], FOLDS, "a part of the curve is missing"),
        (CORNERS[:1], (), "no curve"),
        (CORNERS[[0, 1, 2, 1, 0]], FOLDS, "turned back and came to its start"),
        (np.array([[]]), (), "no curve"),
        (CORNERS, FOLDS[:1], "2 folds, reported: -0.5"),
        (CORNERS, (), "2 folds, reported: none"),
        (CORNERS, (*FOLDS, 1.0), "2 folds, reported: -0.5, -1, 1"),
        (CORNERS, (-0.5, -0.8), "2 folds, reported: -0.5, -0.8"),
    ],
)
def test_what_is_wrong_is_said(fig7, points, folds, message):
    assert row_of(fig7, made_up(points, folds)).wrong.startswith(message)


def test_a_point_off_the_curve_is_wrong(fig7):
    """Out and back along a spike: no part of the curve is missing."""
    spike = CORNERS[3] + [0.0, 0.0, 0.0, 3.0 * NEAR * fig7.truth.scale[3], 0.0]
    points = [*CORNERS[:4], spike, *CORNERS[3:]]
    assert row_of(fig7, made_up(points)).wrong.startswith("leaves the curve by 0.06")


def test_a_fold_reported_twice_at_one_place_is_no_mistake(fig7):
    assert not row_of(fig7, made_up(CORNERS, (*FOLDS, -0.999999))).wrong


def test_a_missing_fold_next_to_another_is_seen():
    """Two folds of example1 are closer to each other than what counts as near."""
    case = load_case("example1")
    true = sorted(float(x[-1]) for x in case.truth.folds)
    assert true[1] - true[0] < NEAR * case.truth.scale[-1]
    ends = [(x, y) for piece in case.truth.pieces for x, y in [piece.ends()]]
    points = joined(ends, start(case))
    assert not row_of(case, made_up(points, tuple(true))).wrong
    assert row_of(case, made_up(points, tuple(true[1:]))).wrong.startswith("4 folds, reported: ")


def joined(ends, x):
    """Return the corners of a curve from the ends of its straight pieces."""
    points, left = [x], list(ends)
    while left:
        i, pair = next((i, p) for i, p in enumerate(left) if any(np.allclose(x, e) for e in p))
        del left[i]
        x = pair[1] if np.allclose(x, pair[0]) else pair[0]
        points.append(x)
    return points


# -- the same table, data and picture -------------------------------------------------------------


def test_peers_are_lines_of_the_same_picture(fig7):
    rows = [row_of(fig7, made_up(CORNERS, peer=f"peer {i}")) for i in (1, 2)]
    rows.append(row_of(fig7, made_up(CORNERS[:3], peer="peer 2")))
    figure = draw([fig7.name], rows)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels[:2] == ["peer 1", "peer 2"]
    crosses = [x for x in figure.axes[0].lines if x.get_marker() == "x" and len(x.get_xdata())]
    assert len(crosses) == 1


def test_colours_and_markers_differ(fig7):
    row = row_of(fig7, made_up(CORNERS))
    names = ["exact linear", "natural parameter", *(f"peer {i}" for i in range(7))]
    handles = draw([fig7.name], [replace(row, stepper=name) for name in names]).legends[0]
    looks = [(h.get_color(), h.get_marker()) for h in handles.legend_handles[: len(names)]]
    assert len({str(look) for look in looks}) == len(names)


def test_table_and_data(fig7):
    rows = [row_of(fig7, made_up(CORNERS)), row_of(fig7, made_up(CORNERS[:3]))]
    text = as_text([fig7], rows, {"other": "not on this machine"}, machine())
    assert "WRONG: stopped at alpha = -1" in text
    assert "left out: other: not on this machine" in text
    data = as_dict([fig7], rows, {}, quick=False)
    assert json.loads(json.dumps(data)) == data
    assert data["rows"][0]["setting"] == {"tolerance": 1e-6}
    assert [row["right"] for row in data["rows"]] == [True, False]


# -- what peers are told --------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["fig7", "example1"])
def test_start_and_equations_are_those_of_the_bench(name):
    case = load_case(name)
    problem, x = contact(case), start(case)
    assert x[-1] == case.interval[0]
    A, N, T, f0, f1 = (np.array(problem[key]) for key in ("A", "N", "T", "f0", "f1"))
    n, p = len(f0), len(N)
    u, lam_nu, lam_t = np.split(x[:-1], (n, n + p))
    balance = A @ u - lam_nu @ N - lam_t @ T - f0 - x[-1] * f1
    np.testing.assert_allclose(balance, 0.0, atol=1e-13)


def test_smoothed_start(fig7):
    """Smoothing by eps moves a solution by about eps, and there is none without."""
    problem, x = contact(fig7), start(fig7)
    np.testing.assert_array_equal(auto07p.smoothed(problem, x, 0.0), x[:-1])
    moved = np.abs(auto07p.smoothed(problem, x, 1e-2) - x[:-1]).max()
    assert 1e-5 < moved < 1e-2


def test_other_problems_have_no_adapter():
    circle = load_case("circle")
    assert by_getfem.curves(circle) == auto07p.curves(circle)
    assert "no adapter" in by_getfem.curves(circle)
    assert auto07p.idle(circle) is None


def test_files_of_auto_are_read():
    """Two solutions of two unknowns, as fort.8 has them; the second a limit point (type 2)."""
    header = "1 {n} {type} {n} 1 1 1 3 5 0 0 2 0 1 0 0"
    body = "0.0 {u} 2.0\n1\n1.0\n0.1 0.2\n{alpha} 0.0"
    first = header.format(n=1, type=-4) + "\n" + body.format(u=1.0, alpha=-0.5)
    second = header.format(n=2, type=2) + "\n" + body.format(u=3.0, alpha=-0.25)
    points, folds = auto07p.read(f"{first}\n{second}\n")
    np.testing.assert_array_equal(points, [[1.0, 2.0, -0.5], [3.0, 2.0, -0.25]])
    assert folds == (-0.25,)
    assert auto07p.read("")[0].size == 0


# -- what is not there ----------------------------------------------------------------------------


def test_missing_peers_are_reported_as_missing(fig7, monkeypatch, tmp_path):
    monkeypatch.setattr(ask, "PYTHON", str(tmp_path / "python"))
    monkeypatch.setenv("AUTO_DIR", str(tmp_path))
    rows, missing = report.peer_rows(fig7)
    assert rows == []
    assert set(missing) == {"AUTO-07p, fig7", "GetFEM, fig7"}
    assert all(why.startswith("not on this machine") for why in missing.values())
    assert report.by_siconos.report().startswith("Siconos: not on this machine")


@pytest.mark.parametrize("name", ["getfem", "siconos"])
def test_programs_say_that_their_package_is_missing(name):
    if importlib.util.find_spec(name).origin != str(PEERS / f"{name}.py"):
        pytest.skip("it is installed for this Python")
    command = [sys.executable, "-I", str(PEERS / f"{name}.py")]
    run = subprocess.run(command, input="{}", capture_output=True, text=True, check=True)
    assert json.loads(run.stdout) == {"missing": "not on this machine"}


def test_a_program_that_fails_is_reported(fig7, monkeypatch, tmp_path):
    (tmp_path / "getfem.py").write_text("raise SystemExit('out of order')")
    monkeypatch.setattr(ask, "HERE", tmp_path)
    monkeypatch.setattr(ask, "PYTHON", sys.executable)
    assert by_getfem.curves(fig7) == "getfem.py failed with status 1: out of order"
