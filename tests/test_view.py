"""Views in the browser: the records of a page, the files, and what is refused."""

import json
import os
import re
import sys
from base64 import b64decode
from dataclasses import replace
from zipfile import ZipFile

import numpy as np
import pytest
from pwscont_coulomb import CoulombLoad
from pwscont_coulomb.quasi_static.scenes import hysteresis
from pwscont_coulomb.scenes import example3, fig7, fig12

from pwscont import (
    LCP,
    BranchGraph,
    InvalidInputError,
    MissingPackageError,
    PiecewiseSystem,
    UnknownNameError,
    View,
    explore,
)
from pwscont.commands.cli import main
from pwscont.commands.origin import Origin, read_origin, write_origin
from pwscont.extending import BodyPicture, Shapes
from pwscont.scenes.registry import load_scene
from pwscont.view.body import MOST_NUMBERS, outline_of
from pwscont.view.records import dash_of

bokeh = pytest.importorskip("bokeh", reason="views need bokeh: pip install '.[view]'")

TYPES = {"Float64Array": "<f8", "Float32Array": "<f4", "Int32Array": "<i4"}


def unpacked(packed):
    return np.frombuffer(b64decode(packed["bytes"]), TYPES[packed["type"]])


class Cubic(PiecewiseSystem):
    """alpha = z^3 - z: curved, with folds at z = -+ 1 / sqrt 3; an empty test."""

    size = 1

    def test_functions(self, z, alpha):
        return z + 9.0

    def residual(self, z, alpha, character):
        return z**3 - z - alpha


@pytest.fixture(scope="module")
def cubic():
    return explore(Cubic(), (-1.0, 1.0), record={"square": lambda z, alpha: float(z[0] ** 2)})


def rows_of(records):
    return unpacked(records["rows"]).reshape(-1, len(records["names"]))


def line_of(records, piece):
    """Return the rows of a piece, as the page reads them."""
    first, rows = records["pieces"]["first"], unpacked(records["pieces"]["rows"])
    return rows_of(records)[rows[first[piece] : first[piece + 1]]]


def test_rows_of_a_curved_piece_solve_the_equation(cubic):
    records = View(cubic).records
    assert records["names"] == ["alpha", "z[0]", "square"]
    rough = records["rough"][1]  # how far the page says that z may be off the curve
    assert rough < 4e-5
    for piece in range(3):
        alpha, z, square = line_of(records, piece).T
        assert len(alpha) > 20
        assert (np.abs(z**3 - z - alpha) / np.hypot(3.0 * z**2 - 1.0, 1.0)).max() < rough
        assert square == pytest.approx(z**2)
        assert len(set(np.sign(np.diff(alpha)))) == 1  # monotone, so that the page can search
    assert records["pieces"]["curved"] == [True] * 3
    folds = [row for row in records["points"] if row["kind"] == "fold"]
    assert [row["det"] for row in folds] == [0, 0]
    assert sorted(rows_of(records)[row["row"], 1] for row in folds) == pytest.approx(
        [-(3.0**-0.5), 3.0**-0.5], rel=1e-6
    )


def test_without_its_system_a_curved_piece_is_a_smooth_curve_and_says_so(cubic, tmp_path):
    cubic.save(tmp_path / "cubic.npz")
    loaded = View(BranchGraph.load(tmp_path / "cubic.npz"))
    assert loaded.records["digits"] < View(cubic).records["digits"]
    alpha, z = line_of(loaded.records, 1).T
    assert np.abs(z**3 - z - alpha).max() < 1e-2


def test_rows_at_nodes_are_shared():
    graph = fig7().run()
    records = View(graph).records
    assert len(rows_of(records)) == len(graph.pieces) + 1
    assert [len(line_of(records, piece)) for piece in range(4)] == [2, 2, 2, 2]
    for piece, row in zip(graph.pieces, range(4), strict=True):
        assert line_of(records, row)[:, 0] == pytest.approx(piece.alpha, abs=0)


def test_a_recorded_quantity_that_fails_is_no_number():
    def fails(z, alpha):
        return 1.0 / (alpha > 0.0)

    record = {"fails": fails}
    records = View(explore(LCP(np.eye(1), [1.0], [1.0]), (-2.0, 1.0), record=record)).records
    values = rows_of(records)
    assert np.isnan(values[:, 2]).tolist() == (values[:, 0] <= 0.0).tolist()


def test_quantities_that_have_no_room_are_left_out_and_counted(monkeypatch):
    monkeypatch.setattr("pwscont.view.numbers.MOST_NUMBERS", 40)
    graph = example3().run()
    view = View(graph, graph.names[-1])
    names = view.records["names"]
    assert names[0] == graph.parameter
    assert names[-1] == graph.names[-1]  # what is asked for stays
    assert view.records["left_out"] == len(graph.names) + 1 - len(names) > 0


def test_modes_are_told_apart_as_in_pictures():
    scene = fig7()
    records = View.of(scene, scene.run()).records
    styles = records["styles"]
    for style in styles:
        words = [style["words"][i] for i in style["of"]]
        assert words == [piece.label for piece in scene.run().pieces]
    assert records["what"] == "λ_ν"
    assert dash_of("-") == []
    assert dash_of((0, (9, 2))) == [18, 4]
    assert dash_of((0, None)) == []


def test_words_of_special_points_are_the_graphs():
    graph = fig7().run()
    told = {row["node"]: row for row in View(graph).records["points"]}
    for point in graph.special_points():
        assert point.message in told[point.id]["words"] or not point.message
        assert told[point.id]["kind"] == point.kind
        assert told[point.id]["shown"] == (abs(point.alpha) < 2.0)  # not where a branch leaves


def test_a_page_is_one_file_without_addresses_to_load(tmp_path):
    html = View(fig7().run(), title="</script> & <b>").html
    assert not re.findall(r"""<(?:script|link|img)[^>]*(?:src|href)\s*=""", html)
    assert "<b>" not in html.split("<title>")[1].split("</title>")[0]
    records = re.search(r'id="records">(.*?)</script>', html, re.DOTALL)[1]
    assert json.loads(records)["title"] == "</script> & <b>"


def test_in_a_notebook_a_view_is_a_frame():
    view = View(fig7().run())
    frame = view._repr_html_()
    assert frame.startswith("<iframe srcdoc=")
    assert frame.count('"') == 4  # the page is quoted whole
    assert repr(view) == "View(branches, 4 pieces)"


def test_what_is_shown_first_must_be_there(cubic):
    assert View(cubic, "square").what == "square"
    with pytest.raises(UnknownNameError, match="did you mean square"):
        View(cubic, "sqare")
    with pytest.raises(InvalidInputError, match="graph must be a BranchGraph, got 3"):
        View(3)


def test_without_bokeh_one_line_says_what_to_install(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(sys.modules, "bokeh", None)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MissingPackageError, match=r"pip install '\.\[view\]' in a checkout"):
        View(fig7().run())
    assert main(["run", "fig7", "--html", "page.html"]) == 2
    printed = capsys.readouterr()
    assert not printed.out  # refused before any work
    assert len(printed.err.splitlines()) == 1
    assert "pip install '.[view]'" in printed.err


# -- bodies --------------------------------------------------------------------------------------


class Bar(BodyPicture):
    """One square whose upper right corner is moved by (alpha, z); one contact node."""

    def __init__(self, word="stick"):
        self.word = word

    def shapes(self, points):
        square = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
        positions = np.repeat(square[np.newaxis], len(points), axis=0)
        positions[:, 0, 2] += points[:, -1]
        positions[:, 1, 2] += points[:, 0]
        return Shapes(
            corners=np.array([[0, 1, 2, 3]]),
            positions=positions,
            shade=np.abs(points[:, :1, np.newaxis]),
            contact=np.array([2]),
            tangents=np.array([[1.0], [0.0]]),
            pressure=points[:, :1],
            shear=-points[:, :1],
            bound=2.0 * points[:, :1],
            arc=np.array([0.0]),
            part=np.array([0]),
        )

    def contact_states(self, character):
        return [self.word]


def test_a_body_of_ones_own(cubic):
    body = View(cubic, body=Bar()).records["body"]
    rows = rows_of(View(cubic).records)
    positions = unpacked(body["positions"]).reshape(-1, 2, 4)
    assert positions[:, 0, 2] == pytest.approx(1.0 + rows[:, 0], abs=1e-6)
    assert positions[:, 1, 2] == pytest.approx(1.0 + rows[:, 1], abs=1e-6)
    assert body["states"] == [[1]] * 3
    with pytest.raises(Exception, match="contact_states of Bar must return one of no contact"):
        _ = View(cubic, body=Bar("glued")).records


def test_of_a_large_body_the_outline_is_shown(cubic, monkeypatch):
    monkeypatch.setattr("pwscont.view.body.MOST_NUMBERS", 1)
    body = View(cubic, body=Bar()).records["body"]
    assert MOST_NUMBERS > 1
    assert sorted(map(sorted, body["corners"])) == [[0, 1], [0, 3], [1, 2], [2, 3]]
    assert "only the outline of 1 elements" in body["note"]
    two = outline_of(np.array([[0, 1, 2], [1, 3, 2]]))
    assert {frozenset(edge) for edge in two.tolist()} == {
        frozenset(edge) for edge in [(0, 1), (0, 2), (1, 3), (2, 3)]
    }


def test_the_elastic_body_is_the_recovered_one():
    pytest.importorskip("skfem", reason="bodies need scikit-fem: pip install '.[fem]'")
    from pwscont_coulomb.elastic import ElasticPicture, recover  # noqa: PLC0415
    from pwscont_coulomb.elastic.scenes import wedge_body  # noqa: PLC0415

    problem = wedge_body(nodes=3).condensed()
    graph = explore(problem.along_load(), (0.0, 0.2))
    picture = ElasticPicture(problem, scale=2.0)
    for solution in graph.solutions(0.07):
        shapes = picture.shapes(np.append(solution.z, solution.alpha)[np.newaxis])
        state = recover(problem, solution)
        moved = problem.elastic.positions + 2.0 * state.displacements.T
        assert shapes.positions[0] == pytest.approx(moved, abs=1e-12)
        assert shapes.pressure[0] == pytest.approx(state.pressure)
        assert shapes.shear[0] == pytest.approx(state.shear)
        assert (np.abs(shapes.shear) <= shapes.bound + 1e-9).all()
        words = picture.contact_states(solution.character)
        for word, slip, bound, shear in zip(
            words, state.slip, shapes.bound[0], state.shear, strict=True
        ):
            if word == "stick":
                assert abs(slip) < 1e-12
            elif word.startswith("slip"):
                assert np.sign(slip) == (1.0 if word == "slip+" else -1.0)
                assert abs(shear) == pytest.approx(bound)


@pytest.mark.slow
def test_the_page_of_the_wedge_is_small(tmp_path):
    pytest.importorskip("skfem", reason="bodies need scikit-fem: pip install '.[fem]'")
    scene = load_scene("wedge").curve()
    page = View.of(scene, scene.run()).save(tmp_path / "wedge.html")
    assert page.stat().st_size < 6_000_000


# -- files and the command line ------------------------------------------------------------------


@pytest.fixture
def written(tmp_path, monkeypatch):
    """Return a directory with the graph of fig7, which becomes the current one."""
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "out" / "fig7.npz"
    path.parent.mkdir()
    fig7().run().save(path)
    write_origin(path, Origin("fig7", {}))
    return tmp_path


def records_of(page):
    text = page.read_text(encoding="utf-8")
    return json.loads(re.search(r'id="records">(.*?)</script>', text, re.DOTALL)[1])


@pytest.mark.slow
def test_a_run_writes_its_scene_into_the_file_of_the_graph(tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    assert main(["run", "example3", "-o", str(tmp_path)]) == 0
    assert read_origin(tmp_path / "example3.npz") == Origin("example3", {})
    assert BranchGraph.load(tmp_path / "example3.npz").pieces


def test_a_damaged_scene_is_said(written, capsys):
    with ZipFile("out/fig7.npz", "a") as file, pytest.warns(UserWarning, match="Duplicate"):
        file.writestr("scene.json", "[]")
    assert main(["view", "out/fig7.npz"]) == 2
    assert "names its scene in a damaged way" in capsys.readouterr().err


@pytest.mark.slow
def test_view_rebuilds_the_scene_that_the_file_names(written, capsys):
    assert main(["view", "out/fig7.npz"]) == 0
    assert capsys.readouterr().out.endswith("written: out/fig7.html\n")
    records = records_of(written / "out/fig7.html")
    assert records["title"].startswith("fig7: ")
    assert main(["run", "fig7", "--html", "page.html"]) == 0
    assert records_of(written / "page.html") == records


def test_a_file_without_a_scene_shows_its_numbers(written, capsys):
    fig12().run().save("curve.npz")
    assert main(["view", "curve.npz", "-o", "page.html"]) == 0
    assert "curve.npz names no scene" in capsys.readouterr().err
    assert records_of(written / "page.html")["title"] == "curve"


def test_a_scene_that_has_changed_is_not_taken(written, capsys, monkeypatch):
    scene = fig7()
    other = CoulombLoad(scene.system.body, scene.system.load, 3.0)
    changed = replace(scene, system=other)
    monkeypatch.setattr("pwscont.commands.view.load_scene", lambda *_: changed)
    assert main(["view", "out/fig7.npz"]) == 0
    assert "is of another system" in capsys.readouterr().err
    assert records_of(written / "out/fig7.html")["title"] == "fig7"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["view", "nothing.npz"], "nothing.npz"),
        (["view", "text.npz"], "not a pwscont branch graph"),
        (["view", "out/fig7.npz", "-o", "nowhere/page.html"], "there is no directory nowhere"),
        (["view", "out/fig7.npz", "-o", "out"], "it is a directory"),
        (["run", "fig7", "--html", "nowhere/page.html"], "there is no directory nowhere"),
        (["run", "fig4", "--html", "page.html"], "scene fig4 has none"),
        (["run", "fig7", "--html", "out/fig7.npz"], "the name of a page ends with .html"),
        (["view", "out/fig7.npz", "-o", "page.png"], "the name of a page ends with .html"),
    ],
)
def test_wrong_input_is_refused_in_one_line(written, capsys, arguments, words):
    (written / "text.npz").write_text("no graph")
    capsys.readouterr()
    assert main(arguments) == 2
    printed = capsys.readouterr()
    assert not printed.out
    assert words in printed.err
    assert len(printed.err.splitlines()) == 1


def test_a_page_that_cannot_be_written_leaves_nothing_behind(tmp_path):
    (tmp_path / "page.html").mkdir()
    with pytest.raises(InvalidInputError, match="cannot write"):
        View(fig7().run()).save(tmp_path / "page.html")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


def test_a_page_never_takes_the_place_of_its_graph(tmp_path, capsys):
    file = tmp_path / "fig7.npz"
    fig7().run().save(file)
    before = file.read_bytes()
    assert main(["view", str(file), "-o", str(file)]) == 2
    assert "it is the graph" in capsys.readouterr().err
    page = file.rename(tmp_path / "fig7.html")
    assert main(["view", str(page)]) == 2
    assert page.read_bytes() == before


def test_an_empty_name_is_refused_in_words(capsys):
    assert main(["view", ""]) == 2
    assert "cannot read" in capsys.readouterr().err
    with pytest.raises(InvalidInputError, match="names no file"):
        View(fig7().run()).save("")


def test_marks_tell_parameters_of_a_short_interval_apart():
    system = LCP(np.eye(1), [1e6 + 0.25], [-1.0])
    words = [row["words"][0] for row in View(explore(system, (1e6, 1e6 + 1))).records["points"]]
    assert words == ["α = 1000000", "α = 1000000.25", "α = 1000001"]


# -- evolutions ------------------------------------------------------------------------------------


def test_rows_of_evolutions_are_their_states():
    graph = hysteresis().run()
    records = View(graph, "u_t").records
    assert records["names"] == ["t", *graph.names]
    for i, piece in enumerate(graph.pieces):
        for row in line_of(records, i):
            assert row[1:] == pytest.approx(graph.on(piece, row[0]).z, abs=1e-13)
    for told in records["points"]:
        state = graph.node(told["node"])
        assert rows_of(records)[told["row"]] == pytest.approx([state.t, *state.z], abs=0)
        assert told["kind"] == state.kind
    for number, path in enumerate(graph.paths()):
        mine = [i for i, owners in enumerate(records["pieces"]["owners"]) if number in owners]
        assert [graph.pieces[i] for i in mine] == sorted(path.pieces, key=graph.pieces.index)
    assert [row["count"] for row in records["stretches"]] == [3, 4, 3, 2, 1]


def test_evolutions_are_shown_on_no_body():
    with pytest.raises(InvalidInputError, match="on a body"):
        View(hysteresis().run(), body=Bar())


@pytest.mark.slow
def test_a_file_of_evolutions_and_its_scene_have_pages(tmp_path, capsys):
    assert main(["run", "hysteresis", "-o", str(tmp_path), "--html", str(tmp_path / "a.html")]) == 0
    assert main(["view", str(tmp_path / "hysteresis.npz")]) == 0
    for page in ("a.html", "hysteresis.html"):
        assert "evolution" in (tmp_path / page).read_text(encoding="utf-8")
    (tmp_path / "other.npz").write_bytes(b"nothing")
    assert main(["view", str(tmp_path / "other.npz")]) != 0
    assert "other.npz" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_page_does_not_replace_a_device(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InvalidInputError, match="it is a device, not a file"):
        View(fig7().run()).save(tmp_path / "pipe")
    assert (tmp_path / "pipe").is_fifo()
