"""Sphinx configuration: ``sphinx-build -b html docs docs/_build/html``."""

import logging
import re
import sys
from importlib import metadata, util
from pathlib import Path

from sphinx_gallery.sorting import ExplicitOrder

#: The tutorials in the order in which a newcomer learns, then those on the packages of problems.
TUTORIALS = (
    "paper_curve",
    "how_many_solutions",
    "own_system",
    "corners_and_branching",
    "look_at_a_branch",
    "critical_friction",
    "exact_map",
    "map_of_non_uniqueness",
    "thousand_bodies",
    "structures",
    "circuits",
    "power_flow",
    "optimisation",
    "dynamics",
)

project = "pwscont"
author = "the pwscont developers"
copyright = author
release = metadata.version("pwscont")

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "_templates", "examples"]
templates_path = ["_templates"]
default_role = "literal"

html_theme = "furo"
html_title = f"pwscont {release}"
html_show_sphinx = False
#: MathJax in one file, from a package, so that formulas need no network; SVG needs no fonts either.
MATHJAX = Path(util.find_spec("sphinx-mathjax-offline").origin).parent / "static/mathjax/tex-svg.js"
mathjax_path = MATHJAX.name
html_static_path = ["static", str(MATHJAX)]
html_css_files = ["scenes.css"]

autosummary_generate = True
autodoc_default_options = {"members": True, "show-inheritance": True}
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say types and shapes
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_ivar = False
napoleon_use_rtype = False

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "within_subsection_order": ExplicitOrder([f"{name}.py" for name in TUTORIALS]),
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_signature": False,
    "show_memory": False,
    "write_computation_times": False,
    "min_reported_time": 10,
    "backreferences_dir": None,
    "capture_repr": (),
}


def _keep_bars(app, what, name, obj, options, lines):
    """Show |x| in a docstring as it stands; reStructuredText would look for a substitution."""
    outside_literals = re.compile(r"(``.*?``)|\|(?=\w)")
    lines[:] = [outside_literals.sub(lambda m: m[1] or r"\|", line) for line in lines]


def _draw(app):
    """Draw the pictures that no tutorial draws, write the page of scenes and those of views."""
    sys.path.insert(0, str(app.srcdir))
    from pictures import draw_all, write_views  # noqa: PLC0415  it takes seconds
    from scenes_page import draw_scenes, scenes_page  # noqa: PLC0415

    logging.getLogger("skfem").setLevel(logging.WARNING)
    built = Path(app.srcdir) / "images" / "built"
    draw_all(built)
    draw_scenes(built)
    write_views(Path(app.srcdir) / "static" / "views")
    page = Path(app.srcdir) / "scenes.rst"
    page.write_text(scenes_page("images/built"), encoding="utf-8")


def setup(app):
    """Register what docstrings and pictures need."""
    app.connect("builder-inited", _draw)
    app.connect("autodoc-process-docstring", _keep_bars)
