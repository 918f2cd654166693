"""A package of a user's own, as the page on extending shows it: installed, listed and run."""

import json
import os
import re
import subprocess
import sys
import tomllib

import numpy as np
import pytest
from pages import blocks, page

from pwscont import InvalidInputError
from pwscont.scenes.registry import settings_of

PYPROJECT = blocks("extending.rst", "toml")[0]
MODULE = next(code for code in blocks("extending.rst") if code.startswith('"""A strut'))
KINDS = ("fold", "transition")


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Put the package where an installer would, with the metadata that installers make of it."""
    folder = tmp_path_factory.mktemp("site")
    (folder / "snapping").mkdir()
    (folder / "snapping" / "__init__.py").write_text(MODULE, encoding="utf-8")
    project = tomllib.loads(PYPROJECT)["project"]
    about = folder / f"{project['name']}-{project['version']}.dist-info"
    about.mkdir()
    named = [f"{key}: {project[key.lower()]}" for key in ("Name", "Version")]
    (about / "METADATA").write_text("\n".join(["Metadata-Version: 2.1", *named, ""]))
    lines = [
        line
        for group, points in project["entry-points"].items()
        for line in (f"[{group}]", *(f"{name} = {where}" for name, where in points.items()))
    ]
    (about / "entry_points.txt").write_text("\n".join([*lines, ""]))
    return folder


def pwscont(site, *arguments, cwd=None):
    """Run the command line in a process of its own that finds the package."""
    path = os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-m", "pwscont", *arguments],
        env=os.environ | {"PYTHONPATH": path, "MPLBACKEND": "Agg"},
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_project_file_names_what_the_package_has():
    project = tomllib.loads(PYPROJECT)
    assert project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"] == ["snapping"]
    names = {}
    exec(compile(MODULE, "snapping", "exec"), names)
    points = project["project"]["entry-points"]["pwscont.scenes"]
    for name, where in points.items():
        module, function = where.split(":")
        assert (module, names[function]().name) == ("snapping", name)


@pytest.mark.slow
def test_the_scene_is_listed_with_its_settings(site):
    listed = pwscont(site, "scenes").stdout
    assert re.search(r"^  snap +a strut, stop at 0\.8 \[-s stop=0\.8\]$", listed, re.MULTILINE)
    assert re.search(r"^  fig7 ", listed, re.MULTILINE)


@pytest.mark.slow
def test_the_commands_of_the_page_run(site, tmp_path):
    install, *commands = re.findall(r"^   \$ (.+)$", page("extending.rst"), re.MULTILINE)
    assert install.startswith("pip install")
    assert len(commands) == 2
    for command in commands:
        program, *arguments = command.split()
        assert program == "pwscont"
        done = pwscont(site, *arguments, cwd=tmp_path)
        assert (done.returncode, done.stderr.partition("written")[0]) == (0, "")
    assert {file.name for file in (tmp_path / "out").iterdir()} == {"snap.png", "snap.npz"}


@pytest.mark.slow
def test_what_it_computes_is_true(site):
    done = pwscont(site, "run", "snap", "-s", "stop=0.9", "--at", "0", "--json")
    found = json.loads(done.stdout)
    roots = np.roots([1.0, 0.0, 4.0, -4.5])  # z^3 - z + 5 (z - 0.9)
    (beyond,) = roots[np.abs(roots.imag) < 1e-12].real
    z = [solution["z"][0] for solution in found["solutions"]]
    assert sorted(z) == pytest.approx([-1.0, 0.0, beyond], abs=1e-12)
    alphas = {kind: [n["alpha"] for n in found["nodes"] if n["kind"] == kind] for kind in KINDS}
    fold = 2.0 / 27.0**0.5
    assert sorted(alphas["fold"]) == pytest.approx([-fold, fold], rel=1e-12)
    assert alphas["transition"] == pytest.approx([0.9**3 - 0.9], rel=1e-12)


@pytest.mark.slow
def test_settings_that_do_not_fit_are_refused(site):
    done = pwscont(site, "run", "snap", "-s", "stop=far")
    assert done.returncode == 2
    assert done.stderr == "pwscont: stop of scene snap must be a number, got 'far'\n"
    done = pwscont(site, "run", "snap", "-s", "spot=1")
    assert "has no setting 'spot'; it has stop=0.8" in done.stderr


def marked(on: bool = False, count: int = 3):
    return on, count


def test_settings_that_are_true_or_false():
    assert settings_of("s", marked, {"on": "true"}) == {"on": True}
    assert settings_of("s", marked, {"on": "False", "count": "4"}) == {"on": False, "count": 4}
    with pytest.raises(InvalidInputError, match="on of scene s must be true or false, got 'maybe'"):
        settings_of("s", marked, {"on": "maybe"})
