"""A graph as data frames, JSON and text."""

import builtins
import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from data_parts import SCENES, Circle, answer_of, of_another, power, with_record
from elastic_bodies import jammed
from pwscont_coulomb import AffineLoad, CoulombLoad
from pwscont_coulomb.elastic import recover
from pwscont_coulomb.scenes import fig7
from random_bodies import contact_body, random_body

from pwscont import (
    BranchGraph,
    InvalidInputError,
    MissingPackageError,
    explore,
    trace,
)
from pwscont.scenes.graph_answer import GraphAnswer

# -- pandas --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def plain():
    return fig7().run()


@pytest.fixture(scope="module")
def recorded(plain):
    return with_record(plain, power=power)


@pytest.fixture(params=SCENES, ids=lambda scene: scene.__name__)
def graph(request):
    return answer_of(request.param)


def test_pieces_as_a_data_frame(graph):
    frame = graph.to_dataframe("pieces")
    assert frame["id"].tolist() == [p.id for p in graph.pieces]
    assert frame["label"].tolist() == [p.label for p in graph.pieces]
    assert frame["det_sign"].tolist() == [p.det_sign for p in graph.pieces]
    assert list(zip(frame["alpha_lo"], frame["alpha_hi"], strict=True)) == [
        p.interval for p in graph.pieces
    ]
    assert frame["points"].tolist() == [len(p.points) for p in graph.pieces]
    assert frame.groupby("component").size().tolist() == [len(c) for c in graph.components()]
    assert frame["length"].sum() == pytest.approx(graph.nx.size(weight="length"))


def test_points_as_a_data_frame(graph):
    frame = graph.to_dataframe("points")
    points = np.vstack([piece.points for piece in graph.pieces])
    np.testing.assert_array_equal(frame[[*graph.names, "alpha"]], points)
    assert frame.groupby("piece").size().tolist() == [len(p.points) for p in graph.pieces]
    assert frame["label"].iloc[-1] == graph.pieces[-1].label


def test_special_points_as_a_data_frame(graph):
    frame, points = graph.to_dataframe("special"), graph.special_points()
    assert list(frame["kind"]) == [str(p.kind) for p in points]
    assert list(frame["alpha"]) == [p.alpha for p in points]
    assert list(frame["message"]) == [p.message for p in points]
    np.testing.assert_array_equal(frame[list(graph.names)], [p.z for p in points])
    assert list(frame["error"]) == [p.error[-1] for p in points]
    assert list(frame["digits"]) == [p.digits for p in points]


def test_recorded_values_are_columns(recorded, tmp_path):
    frame = recorded.to_dataframe("points")
    np.testing.assert_array_equal(frame["power"], frame["alpha"] * frame["u_t"])
    special = recorded.to_dataframe("special")
    np.testing.assert_array_equal(special["power"], special["alpha"] * special["u_t"])
    recorded.save(tmp_path / "graph")
    loaded = BranchGraph.load(tmp_path / "graph")
    assert loaded.to_dataframe("special").equals(special)
    assert loaded.to_dataframe("pieces").equals(recorded.to_dataframe("pieces"))


def test_a_start_within_a_piece_is_a_special_point(plain):
    graph = trace(plain.system, ((0, 0, -0.25, 0.0), 0.0), (-2.0, 2.0))
    frame = graph.to_dataframe("special")
    assert frame["alpha"][frame["id"] == -1].tolist() == [0.0]


def test_unknowns_called_like_other_columns():
    class Nameless(Circle):
        size = 3

        def residual(self, z, alpha, character):
            return np.array([z[0] - alpha, z[1] - z[0], z[2] - 2.0 * z[0]])

    class Twice(Nameless):
        def names(self):
            return "alpha", "u", "u"

    graph = of_another(explore(Nameless(), (-0.5, 0.5)), Twice())
    frame = graph.to_dataframe("points")
    assert list(frame.columns) == ["piece", "component", "label", "alpha", "z[0]", "u", "z[2]"]
    np.testing.assert_allclose(frame["z[2]"], 2.0 * frame["alpha"], atol=1e-12)


@pytest.mark.parametrize(
    ("names", "called"),
    [
        (("z",), ["z"]),
        (("start",), ["start"]),
        (("name",), ["z[0]"]),
        (("alpha", "z[0]"), ["z[0]", "z[1]"]),
        (("z[1]", "z[0]"), ["z[0]", "z[1]"]),
        (("z", "digits"), ["z", "z[1]"]),
    ],
)
@pytest.mark.sweep(6)
def test_columns_of_unknowns_are_their_names_or_places(names, called):
    given = names

    class Line(Circle):
        size = len(given)

        def names(self):
            return given

        def residual(self, z, alpha, character):
            return z - np.arange(1, self.size + 1) * alpha

    graph = explore(Line(), (-0.5, 0.5))
    for rows in ("points", "special"):
        frame = graph.to_dataframe(rows)
        assert frame.columns.is_unique
        for i, column in enumerate(called):
            np.testing.assert_allclose(frame[column], (i + 1) * frame["alpha"], atol=1e-12)
    assert graph.solutions(0.25)[0][names[0]] == pytest.approx(0.25)


@pytest.mark.parametrize("rows", ["pieces", "points", "special"])
def test_an_empty_graph(rows):
    assert BranchGraph([], [], (0.0, 1.0)).to_dataframe(rows).empty
    assert BranchGraph([], [], (0.0, 1.0)).nx.number_of_nodes() == 0


@pytest.mark.parametrize("rows", ["piece", "", None])
def test_other_rows_are_refused(plain, rows):
    with pytest.raises(InvalidInputError, match=r"pieces, points, special"):
        plain.to_dataframe(rows)


def test_without_pandas(plain, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingPackageError, match="pip install pandas"):
        plain.to_dataframe("pieces")
    assert issubclass(MissingPackageError, builtins.ImportError)


# -- JSON ----------------------------------------------------------------------------------------


def test_json_has_names(graph):
    data = json.loads(json.dumps(graph.to_dict(), allow_nan=False))
    assert data["names"] == list(graph.system.names())
    assert "not_recorded" not in data
    assert all(len(node["z"]) == len(data["names"]) for node in data["nodes"])


def test_json_of_the_command_line(recorded):
    """Nodes and solutions asked for have what is recorded, or why it is not."""
    failing = with_record(recorded, bad=lambda z, alpha: 1.0 / (alpha - 0.5))
    answer = GraphAnswer(fig7(), failing, (0.5, 1.5)).as_dict()
    data = json.loads(json.dumps(answer, allow_nan=False))
    assert data["names"] == list(recorded.names)
    first, second = data["solutions"]
    assert (first["recorded"]["bad"], second["recorded"]["bad"]) == (None, 1.0)
    assert all(node["recorded"]["power"] is not None for node in data["nodes"])
    (why,) = data["not_recorded"]
    assert why.startswith("record 'bad' failed at alpha = 0.5: ZeroDivisionError")


# -- how records look ----------------------------------------------------------------------------


def assert_short(thing, *words):
    """A terminal shows a few lines of it, a notebook a small table; both say what it is."""
    text = repr(thing)
    assert text.count("\n") <= 3
    assert len(text) < 500
    assert type(thing).__name__ in text
    assert all(word in text for word in words), text
    html = thing._repr_html_()
    assert html.startswith("<table>")
    assert len(html) < 2000


def many_nodes(p=40):
    body = contact_body(random_body(p, seed=1))
    return CoulombLoad(body, AffineLoad(np.ones(body.n), np.ones(body.n)), 0.3)


def test_records_are_short_whatever_their_size():
    system = many_nodes()
    graph = trace(system, (np.zeros(system.size), 0.0), (0.0, 0.01))
    point, piece = graph.special_points()[0], graph.pieces[0]
    assert_short(point, f"alpha={point.alpha:.10g}", str(point.kind), f"{system.size} unknowns")
    assert_short(piece, "det +1", "points")
    assert_short(graph.solutions(0.005)[0], "alpha=0.005", f"{system.size} unknowns")
    assert_short(system, f"{system.size} unknowns", f"{3 * system.body.p} tests")
    assert_short(system.body, f"{system.body.n} displacements", "40 contact nodes")


def test_small_records_show_all(plain):
    assert repr(plain.solutions(0.25)[0]) == (
        "Solution(stick, alpha=0.25, det +1, u_ν=0, u_t=0, λ_ν=-0.25, λ_t=-0.25)"
    )
    assert repr(plain.pieces[2]) == "Piece(2: stick, alpha -1 → 1, det +1, 2 points)"
    assert repr(plain.multiplicity()[0]) == "Stretch([-2, -1): 1 solution)"
    assert_short(plain.multiplicity()[1], "3 solutions")
    assert "z=[-1]" in repr(explore(Circle(), (-0.5, 0.5)).solutions(0.0))


def test_systems_of_ones_own():
    assert repr(Circle()) == "Circle(1 unknown)"
    assert_short(Circle())

    class Unfinished(Circle):
        @property
        def size(self):
            raise AttributeError("not set yet")

    assert repr(Unfinished()) == "Unfinished()"


def test_elastic_bodies_and_their_states():
    problem = jammed().condensed()
    (first, *_) = explore(problem.along_load(), (-1.0, 1.0)).solutions(0.5)
    nodes = problem.elastic.space.count
    assert_short(problem.elastic, f"{nodes} nodes", f"{problem.body.p} contact nodes")
    assert_short(recover(problem, first), "alpha=0.5", f"{nodes} nodes", "in contact")


def test_notebooks_escape_what_a_user_wrote(plain):
    point = replace(plain.point(0), message="<script>alert(1)</script>")
    assert "<script>" not in point._repr_html_()


# -- the manual ----------------------------------------------------------------------------------


def test_the_page_of_the_manual_runs(tmp_path, monkeypatch, capsys):
    """Its code runs, and what stands behind an arrow is the answer."""
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[1] / "docs" / "data.rst").read_text(encoding="utf-8")
    blocks = re.findall(r"^\.\. code-block:: python\n\n((?:   .*\n|\n)+)", page, re.MULTILINE)
    namespace, answers = {}, 0
    for block in blocks:
        code = re.sub(r"^   ", "", block, flags=re.MULTILINE)
        exec(compile(code, "data.rst", "exec"), namespace)
        for question, answer in re.findall(r"^(.+?)  # -> (.+)$", code, re.MULTILINE):
            assert repr(eval(question, namespace)) == answer
            answers += 1
    assert (len(blocks), answers) == (5, 11)
    assert {file.name for file in tmp_path.iterdir()} == {"fig7.graphml", "fig7.npz"}
