"""The command line: what it prints and writes, what it refuses, and how it ends."""

import json
from importlib import import_module
from importlib.metadata import entry_points
from itertools import pairwise

import numpy as np
import pytest
from cli_parts import CONTACT, CURVES, NAMES, OTHERS, run, run_json
from PIL import Image
from sweeps import swept

from pwscont import BranchGraph, EvolutionGraph, EvolutionScene, Scene
from pwscont.basics.errors import SceneNotFoundError
from pwscont.commands import run as running
from pwscont.commands.cli import main
from pwscont.scenes.answer import Runnable
from pwscont.scenes.registry import load_scene
from pwscont.two_parameters.scene import PlaneScene

pytestmark = pytest.mark.sweep(2)  # the others take too long for the README's command


ELASTIC = ("block", "press", "wedge")  # with the body at the listed solutions


PLANES = ("fig4", "fig5", "fig6", "example1-load-plane", "example1-critical-friction")


HISTORIES = [name for name in NAMES if isinstance(load_scene(name), EvolutionScene)]


WRITTEN = (
    "fig7",
    "block",
    "fig5",
    "hysteresis",
)  # one of each kind; the others, which are longer, are written by the slow tests


#: Scenes of contact that take seconds.
LONG = ("cattaneo", "example1-critical-friction")


OF_CONTACT = [name for name in NAMES if name in CONTACT and name not in LONG]


FILED = [name for name in NAMES if name in (*CONTACT, *CURVES)]


EVERY_SCENE = pytest.mark.parametrize("name", swept(OF_CONTACT, [*LONG, *OTHERS]), scope="module")


PNG = b"\x89PNG\r\n"


#: Every scene's keys, and their types.
SCHEMA = {
    "scene": str,
    "parameter": dict,
    "components": int,
    "nodes": list,
    "pieces": list,
    "multiplicity": list,
    "balance": dict,
    "solutions": list,
    "seconds": float,
}


def refused(capsys, *arguments):
    """Return the message of a command that ends with status 2 and prints nothing else."""
    status, out, err = run(capsys, *arguments)
    assert status == 2
    assert out == ""
    assert err.startswith("pwscont: ")
    assert err.count("\n") == 1
    return err


@pytest.fixture
def idle(monkeypatch):
    """Fail if a scene begins to work."""
    for kind in (Scene, PlaneScene):
        monkeypatch.setattr(kind, "solve", lambda *_: pytest.fail("work has begun"))


ANSWERS = {}


@pytest.fixture
def solved_once(monkeypatch):
    """Solve every scene once, however often its answer is printed."""
    solve = running._solved

    def known(scene, at):
        key = scene.name, tuple(at)
        if key not in ANSWERS:
            ANSWERS[key] = solve(scene, at)
        return ANSWERS[key]

    monkeypatch.setattr(running, "_solved", known)


# -- every scene -------------------------------------------------------------------------------


def test_scenes_are_listed_with_their_titles(capsys):
    status, out, _ = run(capsys, "scenes")
    assert status == 0
    lines = [line for line in out.splitlines() if line.startswith("  ")]
    lines.sort(key=lambda line: NAMES.index(line.split()[0]))
    assert [line.split()[0] for line in lines] == NAMES
    assert NAMES.index("fig7") < NAMES.index("fig10")
    for line, name in zip(lines, NAMES, strict=True):
        assert line.split(" [-s ")[0].endswith(load_scene(name).title)
    assert set(PLANES) <= set(NAMES)


@pytest.mark.slow
def test_scenes_are_grouped_by_package(capsys):
    out = run(capsys, "scenes")[1]
    points = {point.name: point.module for point in entry_points(group="pwscont.scenes")}
    package = ""
    for line in out.splitlines():
        if not line.startswith("  "):
            package, _, words = line.partition(": ")
            assert words == import_module(package).__doc__.splitlines()[0]
        else:
            assert points[line.split()[0]].split(".")[0] == package


@EVERY_SCENE
def test_every_scene_is_runnable(name):
    scene = load_scene(name)
    assert isinstance(scene, Runnable)
    assert scene.name == name


@EVERY_SCENE
@pytest.mark.usefixtures("solved_once")
@pytest.mark.sweep(6)
def test_every_scene_prints_a_table(capsys, name):
    status, out, _ = run(capsys, "run", name)
    assert status == 0
    scene = load_scene(name)
    assert out.startswith(f"{name}: {scene.title}\n{scene.parameter} in ") or name in PLANES
    assert "solution" in out
    assert "nan" not in out
    assert "Traceback" not in out


@pytest.mark.slow
@EVERY_SCENE
@pytest.mark.usefixtures("solved_once")
def test_json_follows_the_schema(capsys, name):
    data = run_json(capsys, name)
    for key, kind in SCHEMA.items():
        assert isinstance(data[key], kind), key
    assert data["scene"] == name
    lo, hi = data["parameter"]["lo"], data["parameter"]["hi"]
    assert isinstance(data["parameter"]["name"], str)
    assert data["seconds"] >= 0.0
    assert data["balance"] == {"value": 1, "constant": True} or name in (*OTHERS, *HISTORIES)
    rows = data["multiplicity"]
    assert (rows[0][0], rows[-1][1]) == (lo, hi)
    assert all(before[1] == after[0] for before, after in pairwise(rows))


@EVERY_SCENE
@pytest.mark.usefixtures("solved_once")
@pytest.mark.sweep(4)
def test_json_nodes_and_pieces_fit_together(capsys, name):
    data = run_json(capsys, name)
    nodes = {node["id"]: node for node in data["nodes"]}
    assert len(nodes) == len(data["nodes"])
    assert {piece["component"] for piece in data["pieces"]} == set(range(data["components"]))
    assert len({piece["id"] for piece in data["pieces"]}) == len(data["pieces"])
    for piece in data["pieces"]:
        assert len(piece["alpha"]) == len(piece["points"])
        assert isinstance(piece["label"], str)
        for end, i in (("start", 0), ("end", -1)):
            node = nodes[piece[end]]
            assert {"id", "kind", "alpha", "z"} <= set(node)
            assert piece["alpha"][i] == pytest.approx(node["alpha"], abs=1e-7)
            np.testing.assert_allclose(piece["points"][i], node["z"], rtol=0.0, atol=1e-6)
    for solution in data["solutions"]:
        assert {"alpha", "z", "label", "det_sign"} <= set(solution)


@pytest.mark.parametrize("name", swept(WRITTEN, [n for n in FILED if n not in WRITTEN]))
def test_output_writes_readable_files(capsys, tmp_path, monkeypatch, name):
    monkeypatch.setattr("pwscont_coulomb.elastic.scene.FRAMES", 3)
    directory = tmp_path / "not yet" / "there"
    moving = ["-s", "nodes=5", "--animate"] if name == "block" else []
    status, out, err = run(capsys, "run", name, "-o", str(directory), *moving)
    assert status == 0
    assert out
    picture, data = directory / f"{name}.png", directory / f"{name}.npz"
    if name in PLANES:
        data = data.with_suffix(".json")
        assert json.loads(data.read_text(encoding="utf-8"))["scene"] == name
    elif name in HISTORIES:
        assert EvolutionGraph.load(data).interval == load_scene(name).interval
    else:
        assert BranchGraph.load(data).interval == load_scene(name).interval
    assert picture.read_bytes().startswith(PNG)
    assert picture.stat().st_size > 10_000
    assert f"written: {picture}, {data}" in err
    bodies = [file for file in directory.iterdir() if file.stem.startswith(f"{name}-")]
    assert sorted(directory.iterdir()) == sorted([picture, data, *bodies])
    kinds = {".png", ".vtu", *([".gif"] if moving else [])} if name in ELASTIC else set()
    assert {file.suffix for file in bodies} == (
        {".png"} if name in ("block-cycle", "cattaneo") else kinds
    )


@pytest.mark.parametrize(
    "name", swept([n for n in PLANES if n not in LONG], [PLANES[4]]), scope="module"
)
@pytest.mark.usefixtures("solved_once")
def test_plane_scenes_tell_their_loci_and_sectors(capsys, name):
    data = run_json(capsys, name)
    assert data["mixed"] == []
    assert {s["crossing"] for some in data["loci"] for s in some} <= {
        "fold",
        "transition",
        "vertical",
    }
    counts = [sector["count"] for sector in data["sectors"]]
    assert max(counts) == {"fig4": 1, "fig5": 3, "fig6": 1, "example1-load-plane": 7}.get(name, 5)
    assert len(data["solutions"]) == sum(counts)
    assert all(len(s["z"]) == len(data["unknowns"]) for s in data["solutions"])
    if name == "example1-critical-friction":
        tips = data["lowest_folds"]
        assert [tip["alpha"] for tip in tips] == pytest.approx([2.0, 2.0], abs=1e-9)


@pytest.mark.usefixtures("solved_once")
def test_plane_scenes_print_sectors(capsys):
    _, out, _ = run(capsys, "run", "fig5")
    assert "  σ₅ = σ₁ ∩ σ₂, 3 solutions at (f_ν, f_t) = " in out
    assert "slip- | no contact: fold" in out
    _, out, _ = run(capsys, "run", "fig6")
    assert "stick | slip-: transition, with infinitely many solutions on it" in out


@pytest.mark.slow
@pytest.mark.usefixtures("solved_once")
def test_a_plane_scene_prints_its_critical_friction(capsys):
    _, out, _ = run(capsys, "run", "example1-critical-friction")
    assert "The critical F is 2: folds begin at (alpha, F) = (-1.2941176, 2) and" in out


# -- which solutions are listed ------------------------------------------------------------------


def test_at_is_repeatable_and_takes_negative_values(capsys):
    data = run_json(capsys, "fig7", "--at", "-0.75", "-1e-3", "--at=-.6", "--at", "1")
    alphas = [s["alpha"] for s in data["solutions"]]
    assert alphas == [-0.75] * 3 + [-1e-3] + [-0.6] * 3 + [1.0]


def test_at_replaces_the_values_of_the_scene(capsys):
    assert load_scene("fig7").at == (-0.75,)
    assert {s["alpha"] for s in run_json(capsys, "fig7")["solutions"]} == {-0.75}
    assert {s["alpha"] for s in run_json(capsys, "fig7", "--at", "0")["solutions"]} == {0.0}
    _, out, _ = run(capsys, "run", "fig7", "--at", "-0.75")
    assert "3 solutions at alpha = -0.75" in out


def test_at_the_ends_of_the_interval(capsys):
    data = run_json(capsys, "fig7", "--at", "-2", "2")
    assert [s["alpha"] for s in data["solutions"]] == [-2.0, 2.0]


@pytest.mark.usefixtures("idle")
@pytest.mark.parametrize("value", ["2.0001", "-1e9", "nan", "inf", "-inf"])
def test_at_outside_the_interval_is_refused_before_any_work(capsys, value):
    message = refused(capsys, "run", "fig7", "--at", "0", value)
    assert f"--at {float(value)} lies outside the interval [-2.0, 2.0] of scene fig7" in message


@pytest.mark.usefixtures("idle")
@pytest.mark.parametrize("name", PLANES)
def test_at_is_refused_where_there_are_two_parameters(capsys, name):
    message = refused(capsys, "run", name, "--at", "0.5")
    assert f"{name} has two" in message
    assert "run it without --at" in message


@pytest.mark.usefixtures("idle")
@pytest.mark.parametrize(
    "arguments", [[], ["run"], ["run", "fig7", "--at"], ["run", "fig7", "--at", "x"], ["ran"]]
)
def test_wrong_usage_ends_with_status_2(capsys, arguments):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    assert "usage: pwscont" in capsys.readouterr().err


@pytest.mark.usefixtures("idle")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "fig7", "--ta", "0.3"], "pwscont run: error: unrecognized arguments: --ta 0.3; "),
        (["run", "fig7", "--ta", "0.3"], "did you mean --at?"),
        (["run", "fig7", "--interval", "2", "-2"], "unrecognized arguments: --interval 2 -2\n"),
        (["scenes", "fig7"], "usage: pwscont scenes"),
        (["run", "block", "-s", "nodes=2", "nodes=3"], "argument -s/--set: nodes is set twice"),
    ],
)
def test_unknown_arguments_are_refused_by_their_command(capsys, arguments, words):
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    assert words in capsys.readouterr().err


# -- scenes and directories that are not there -------------------------------------------------


@pytest.mark.parametrize(
    ("name", "near"), [("fig77", "fig7"), ("exampel3", "example3"), ("critical", "critical")]
)
def test_unknown_scene_names_near_matches(capsys, name, near):
    message = refused(capsys, "run", name)
    assert f"there is no scene {name!r}; did you mean " in message
    assert near in message.split("did you mean")[1]


def test_unknown_scene_without_near_matches(capsys):
    assert "see 'pwscont scenes'" in refused(capsys, "run", "zzzzz")
    with pytest.raises(SceneNotFoundError):
        load_scene("")


@pytest.mark.usefixtures("idle")
@pytest.mark.parametrize("below", [[], ["deeper"]])
def test_a_directory_that_cannot_be_made_is_refused_before_any_work(capsys, tmp_path, below):
    (tmp_path / "file").write_text("in the way")
    directory = tmp_path.joinpath("file", *below)
    message = refused(capsys, "run", "fig7", "-o", str(directory))
    assert f"cannot make the directory {directory}: " in message


@pytest.mark.slow
def test_a_file_that_cannot_be_written_ends_with_status_2(capsys, tmp_path):
    (tmp_path / "fig7.npz").mkdir()
    status, out, err = run(capsys, "run", "fig7", "-o", str(tmp_path))
    assert status == 2
    assert "Branch 1" in out  # the answer is not lost
    assert "fig7.npz" in err


def test_interruption_ends_with_status_130(capsys, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(Scene, "solve", interrupt)
    status, out, err = run(capsys, "run", "fig7")
    assert (status, out, err) == (130, "", "pwscont: interrupted\n")


# -- how pictures look ---------------------------------------------------------------------------


@pytest.mark.slow
def test_looks_of_pictures(capsys, tmp_path):
    options = ["-o", str(tmp_path), "--format", "svg", "--dpi", "50", "--panels", "u_t", "2"]
    status, _, err = run(capsys, "run", "fig7", *options)
    assert status == 0
    assert "fig7.svg" in err
    assert sorted(file.name for file in tmp_path.iterdir()) == ["fig7.npz", "fig7.svg"]


@pytest.mark.slow
def test_resolution_is_what_was_asked_for(capsys, tmp_path):
    sizes = []
    for dots in (40, 80):
        run(capsys, "run", "fig7", "-o", str(tmp_path), "--dpi", str(dots))
        with Image.open(tmp_path / "fig7.png") as picture:
            sizes.append(picture.size)
    assert np.array(sizes[1]) == pytest.approx(2 * np.array(sizes[0]), abs=2)


@pytest.mark.usefixtures("idle")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fig7", "-o", "out", "--scale", "2"], "--scale is about bodies, and scene fig7 draws"),
        (
            ["fig7", "-o", "out", "--animate"],
            "--animate is about bodies, and scene fig7 draws none",
        ),
        (["fig7", "--dpi", "100"], "--dpi needs -o DIR: pictures are written there"),
        (["fig7", "--format", "pdf"], "--format needs -o DIR"),
        (["fig7", "-o", "out", "--panels", "u_s"], "did you mean u_t or u_ν?"),
        (["fig7", "-o", "out", "--panels", "4"], "there is no '4'; names are u_ν, u_t, λ_ν, λ_t"),
        (["fig7", "-o", "out", "--panels", "-1"], "there is no '-1'; names are u_ν, u_t"),
        (["fig5", "-o", "out", "--panels", "u_t"], "scene fig5 draws no quantity over a parameter"),
    ],
)
def test_looks_that_fit_no_picture_are_refused_before_any_work(
    capsys, tmp_path, monkeypatch, arguments, words
):
    monkeypatch.chdir(tmp_path)
    assert words in refused(capsys, "run", *arguments)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("idle")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--format", "jpg"], "choose from"),
        (["--dpi", "0"], "must be a whole number from 20 to 1200, got '0'"),
        (["--dpi", "-3"], "must be a whole number from 20 to 1200, got '-3'"),
        (["--dpi", "many"], "must be a whole number from 20 to 1200, got 'many'"),
        (["--dpi", "100000"], "must be a whole number"),
        (["--scale", "0"], "must be a positive number, got '0'"),
        (["--scale", "inf"], "must be a positive number, got 'inf'"),
        (["--scale", "big"], "must be a positive number, got 'big'"),
        (["--panels"], "expected at least one argument"),
    ],
)
def test_looks_of_no_sense_are_refused_in_words(capsys, arguments, words):
    with pytest.raises(SystemExit) as stop:
        main(["run", "block", "-o", "out", *arguments])
    assert stop.value.code == 2
    assert words in capsys.readouterr().err
