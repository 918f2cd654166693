"""The page of a view: Bokeh, its diagrams, the records and the programs of the page in one file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from bokeh.embed import file_html
from bokeh.resources import INLINE

from pwscont.view.figures import document_of

STATIC = Path(__file__).parent / "static"
PROGRAMS = ("data.js", "solutions.js", "body.js", "diagram.js", "page.js")


def page_of(records: dict[str, Any], title: str) -> str:
    """Return the whole page."""
    words: dict[str, Any] = {
        "records": _as_json(records),
        "style": _read("page.css"),
        "programs": "\n".join(map(_read, PROGRAMS)),
        "has_body": records["body"] is not None,
        "heading": title,
    }
    document = document_of(records["body"])
    made = file_html(document, INLINE, title, template=_read("page.html"), template_variables=words)
    return str(made)


def _as_json(records: Any) -> str:
    """Return records as JSON that may stand within a page."""
    return json.dumps(records, ensure_ascii=False).replace("<", "\\u003c")


def _read(name: str) -> str:
    return (STATIC / name).read_text(encoding="utf-8")
