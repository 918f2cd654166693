"""Help of the command line: its examples run; the tab key completes commands and scenes."""

import os
import shlex
import subprocess
import sys
from importlib.util import find_spec

import pytest

import pwscont.__main__ as entry
from pwscont.commands.cli import main
from pwscont.commands.options import EXAMPLES, STATUS
from pwscont.scenes.registry import scene_names

LINES = [line for lines in EXAMPLES.values() for line in lines]


def help_of(capsys, command):
    with pytest.raises(SystemExit) as ended:
        main([*command.split(), "--help"])
    assert ended.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("command", EXAMPLES)
def test_help_shows_examples_and_exit_statuses(capsys, command):
    shown = help_of(capsys, command)
    assert STATUS in shown  # word for word, not filled into lines
    for line, what in EXAMPLES[command].items():
        assert f"  {line}" in shown
        assert what in shown
    assert max(map(len, shown.splitlines())) <= 100


def benches_are_slow(lines):
    """Return the lines as cases, of which those that measure are slow."""
    slow = [pytest.mark.slow]
    return [pytest.param(line, marks=slow if "bench" in line else []) for line in lines]


@pytest.mark.parametrize("line", benches_are_slow(sorted(set(LINES))))
@pytest.mark.sweep(6)
def test_every_example_of_the_help_runs(capsys, monkeypatch, tmp_path, line):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    program, *arguments = shlex.split(line)
    if {"view", "--html"} & {*arguments}:
        pytest.importorskip("bokeh")
    if "view" in arguments:
        main(["run", "fig7", "-o", "out"])
    assert program == "pwscont"
    assert main(arguments) == 0
    assert capsys.readouterr().out.strip()
    if "-o" in arguments:
        assert list((tmp_path / "out").iterdir())


def test_wrong_input_has_the_status_that_the_help_says(capsys, tmp_path):
    assert main(["run", "fig77"]) == 2
    (tmp_path / "out").write_text("a file, no directory")
    assert main(["run", "fig7", "-o", str(tmp_path / "out")]) == 2
    with pytest.raises(SystemExit) as ended:
        main(["jump"])
    assert ended.value.code == 2
    assert capsys.readouterr().out == ""


# -- completion ----------------------------------------------------------------------------------


def asked(tmp_path, line):
    """Return what a shell would offer after ``line``."""
    answer = tmp_path / "answer"
    answer.touch()
    asking = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "COMP_LINE": line}
    asking |= {"COMP_POINT": str(len(line)), "_ARGCOMPLETE_STDOUT_FILENAME": str(answer)}
    code = "from pwscont.__main__ import main; raise SystemExit(main())"
    subprocess.run([sys.executable, "-c", code], env=os.environ | asking, check=True)
    return {word.strip() for word in answer.read_text().splitlines()}


@pytest.mark.slow
@pytest.mark.skipif(not find_spec("argcomplete"), reason="argcomplete is not installed")
def test_the_tab_key_completes_commands_and_scenes(tmp_path):
    assert asked(tmp_path, "pwscont b") == {"bench"}
    assert asked(tmp_path, "pwscont run fig1") == {s for s in scene_names() if "fig1" in s}
    assert asked(tmp_path, "pwscont run --js") == {"--json"}
    assert asked(tmp_path, "pwscont bench fig7 wed") == {"wedge"}


def test_the_marker_stands_where_argcomplete_looks():
    with open(entry.__file__, encoding="utf-8") as file:
        assert "PYTHON_ARGCOMPLETE_OK" in file.read(1024)


@pytest.mark.slow
def test_argcomplete_is_not_loaded_unless_the_shell_asks():
    code = (
        "import sys; from pwscont.commands.cli import main; main(['scenes']); "
        "assert 'argcomplete' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
