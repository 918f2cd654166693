"""The project around the code: one version, a change log, urls, hooks, continuous integration."""

import ast
import io
import re
import tokenize
import tomllib
from importlib import import_module
from importlib.metadata import entry_points, version
from pathlib import Path

import pwscont

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def text(name):
    return (ROOT / name).read_text(encoding="utf-8")


def test_there_is_one_version():
    assert PROJECT["project"]["dynamic"] == ["version"]
    assert PROJECT["tool"]["hatch"]["version"]["path"] == "pwscont/__init__.py"
    assert re.findall(r'^__version__ = "(.+)"$', text("pwscont/__init__.py"), re.MULTILINE) == [
        pwscont.__version__
    ]
    assert version("pwscont") == pwscont.__version__, "install again"


def test_the_change_log_begins_with_this_version():
    headings = re.findall(r"^## \[(.+)\] - (.+)$", text("CHANGELOG.md"), re.MULTILINE)
    newest, when = headings[0]
    assert newest == pwscont.__version__
    assert when == "unreleased" or re.fullmatch(r"\d{4}-\d\d-\d\d", when)


def test_urls_are_named():
    assert all(url.startswith("https://") for url in PROJECT["project"]["urls"].values())


def test_scenes_are_registered():
    named = PROJECT["project"]["entry-points"]["pwscont.scenes"]
    offered = {point.name: point.value for point in entry_points(group="pwscont.scenes")}
    assert named.items() <= offered.items()


ENDS = tokenize.NL, tokenize.NEWLINE, tokenize.ENDMARKER
NO_CODE = {tokenize.COMMENT, tokenize.INDENT, tokenize.DEDENT, *ENDS}
DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef


def lines_of_code(file):
    """Return the numbers of the lines with anything but comments and docstrings."""
    source = file.read_text(encoding="utf-8")
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    lines = {n for t in tokens if t.type not in NO_CODE for n in range(t.start[0], t.end[0] + 1)}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, DOCUMENTED) and ast.get_docstring(node):
            lines -= {*range(node.body[0].lineno, node.body[0].end_lineno + 1)}
    return lines


def test_long_packages_say_why():
    rows = re.findall(r"\* - ``(pwscont_\w+)``\n     - ([\d,]+)\n", text("docs/extending.rst"))
    said = {name: int(lines.replace(",", "")) for name, lines in rows}
    for package in (ROOT / "problems").glob("pwscont_*"):
        files = [f for f in package.rglob("*.py") if not {"scenes", "scenes.py"} & {*f.parts}]
        lines = sum(len(lines_of_code(file)) for file in files)
        assert lines < 400 or abs(said[package.name] - lines) < 0.03 * lines, (package.name, lines)


def test_public_hosts_run_everything_on_every_python():
    workflow = text(".github/workflows/ci.yml")
    assert re.findall(r"- run: (.*)", workflow) == [".ci/run"]
    pythons = re.search(r"python: \[(.*)\]", workflow)[1].replace('"', "").split(", ")
    assert PROJECT["project"]["requires-python"] == f">={pythons[0]}"
    assert len(pythons) > 2


def test_hooks_are_local_and_part_of_ci():
    hooks = text(".pre-commit-config.yaml")
    assert re.findall(r"- repo: (.*)", hooks) == ["local"]
    entries = re.findall(r"entry: (.*?)(?: --force-exclude)?$", hooks, re.MULTILINE)
    assert entries == [".venv/bin/ruff check", ".venv/bin/ruff format --check", ".venv/bin/mypy"]
    assert all(entry in text(".ci/run") for entry in entries)


def test_what_is_installed_for_development_has_every_tool():
    extras = PROJECT["project"]["optional-dependencies"]
    words = " ".join(extras["dev"])
    assert all(tool in words for tool in ("ruff", "mypy", "pre-commit", "test,docs"))


def test_install_hints_name_what_works():
    """The package is on no index yet: ``pip install pwscont[...]`` alone finds nothing."""
    files = [
        path for folder in ("pwscont", "problems", "docs") for path in (ROOT / folder).rglob("*")
    ]
    files = [path for path in files if path.suffix in (".py", ".rst")] + [ROOT / "README.md"]
    for path in files:
        assert not re.search(r"pip install '?pwscont", path.read_text(encoding="utf-8")), path


def resolves(name):
    """Tell whether a dotted name is a module, or something in one."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        try:
            found = import_module(".".join(parts[:count]))
        except ImportError:
            continue
        for part in parts[count:]:
            found = getattr(found, part, None)
        return found is not None
    return False


def sources():
    """Yield all files in which names of modules are written."""
    for folder, ending in [("docs", "rst"), ("docs", "py"), ("pwscont", "py"), ("problems", "py")]:
        yield from (p for p in sorted((ROOT / folder).rglob(f"*.{ending}")) if not is_built(p))
    yield from (ROOT / "README.md", ROOT / "CONTRIBUTING.md")


def is_built(path):
    return bool({"generated", "gallery", "_build"} & set(path.parts))


def test_every_module_that_is_named_exists():
    for path in sources():
        words = path.read_text(encoding="utf-8")
        names = set(re.findall(r"(?<![\w./'\"-])pwscont(?:_[a-z]+)?(?:\.\w+)+", words))
        files = set(re.findall(r"(?:pwscont|tests|benchmarks)/[\w/]+\.py", words))
        missing = [name for name in names if not resolves(name)]
        missing += [file for file in files if not (ROOT / file).exists()]
        assert not missing, f"{path}: {missing}"


def test_every_fact_that_is_cited_stands_in_the_theory():
    facts = set(re.findall(r"^(F\d+), ", text("docs/theory.rst"), re.MULTILINE))
    for path in sources():
        words = path.read_text(encoding="utf-8")
        cited = set(re.findall(r"docs/theory,\s+(F\d+)", words))
        assert cited <= facts, f"{path}: {cited - facts}"
        assert not re.search(r"of the design|design\.md", words), path


def test_every_method_that_the_manual_names_exists():
    for path in sources():
        if path.suffix == ".py" and path.parent.name != "examples":
            continue
        words = path.read_text(encoding="utf-8")
        for name, member in re.findall(r"`([A-Z]\w+)\.(\w+)`", words):
            owner = getattr(pwscont, name, None)
            known = owner is None or hasattr(owner, member) or member in owner.__doc__
            assert known, f"{path}: {name}.{member}"


def test_contributing_lists_the_rooms_top_floor_first():
    rooms = re.findall(r"^\| `(\w+)` \|", text("CONTRIBUTING.md"), re.MULTILINE)
    assert rooms[::-1] == import_module("test_architecture").ROOMS


# -- the tests themselves --------------------------------------------------------------------------

TESTS = ROOT / "tests"
LONGEST_FILE_OF_TESTS = 500


def test_a_table_says_where_the_tests_of_every_module_stand():
    rows = re.findall(r"(?m)^\| (`?)([\w.]+)\1 \| (.+) \|$", text("tests/README.md"))
    named = {word for tick, _, words in rows if tick for word in words.split(", ")}
    named |= {name for tick, name, _ in rows if not tick}
    assert named == {path.stem[5:] for path in TESTS.glob("test_*.py")}
    modules = {
        ".".join(path.relative_to(ROOT / "pwscont").with_suffix("").parts)
        for path in (ROOT / "pwscont").glob("*/**/*.py")
        if path.name != "__init__.py"
    }
    packages = {path.name for path in (ROOT / "problems").glob("pwscont_*")}
    assert {name for tick, name, _ in rows if tick} == modules | packages


def test_files_of_tests_are_short_and_import_no_other_file_of_tests():
    for path in TESTS.rglob("*.py"):
        lines = path.read_text(encoding="utf-8").splitlines()
        assert len(lines) <= LONGEST_FILE_OF_TESTS, path.name
        assert not [line for line in lines if re.match(r"(from|import) test_", line)], path.name


def test_what_files_of_tests_share_stands_in_one_place():
    assert {path.name for path in TESTS.glob("*.py") if not path.name.startswith("test_")} == {
        "conftest.py"
    }
