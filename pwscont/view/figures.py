"""The diagrams and the page of a view.

This module is imported only if a view is asked for. The programs of the page find sources and
ranges by name.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from bokeh.document import Document
from bokeh.embed import file_html
from bokeh.events import DocumentReady, Tap
from bokeh.models import (
    BasicTicker,
    BasicTickFormatter,
    BoxZoomTool,
    ColumnDataSource,
    CustomJS,
    HoverTool,
    Legend,
    LegendItem,
    LinearColorMapper,
    NumeralTickFormatter,
    PanTool,
    PrintfTickFormatter,
    Range1d,
    ResetTool,
    SaveTool,
    Span,
    WheelZoomTool,
)
from bokeh.palettes import Blues256
from bokeh.plotting import figure
from bokeh.resources import INLINE

#: Heights of the diagrams, and room left and right of the axes, in pixels.
TALL, STRIP, CURVES, ROOM, RIGHT = 430, 150, 190, 78, 12
#: Numbers below this power of ten are written with an exponent.
SMALL = -5
#: Usual width of the column of a body, height of tools and colour bar, and least height, in pixels.
COLUMN, BARS, LEAST = 480, 110, 220
BLACK, SLIP, PRESSURE, SHEAR, BOUND = "#000000", "#D55E00", "#0072B2", "#E69F00", "#777777"
PARTS = ("diagram", "strip", "body", "curves")


def document_of(body: dict[str, Any] | None) -> Document:
    """Return the document with all diagrams, and with the diagrams of the body if any."""
    document = Document()
    roots = {"diagram": diagram(), "strip": strip()}
    if body:
        roots |= {"body": body_figure(body), "curves": curves_figure(body)}
    for name, root in roots.items():
        root.name = name
        document.add_root(root)
    begin = CustomJS(code="window.pwscont.begin(Bokeh.documents[Bokeh.documents.length - 1])")
    document.js_on_event(DocumentReady, begin)
    return document


def _figure(tall: int, tools: str, **more: Any) -> Any:
    wheel, pan = WheelZoomTool(), PanTool()
    some = {"wheel": wheel, "pan": pan, "box": BoxZoomTool(), "reset": ResetTool()}
    some |= {"save": SaveTool()}
    plot = figure(
        height=tall,
        sizing_mode="stretch_width",
        tools=[some[name] for name in tools.split()],
        min_border_left=ROOM,
        min_border_right=RIGHT,
        x_range=Range1d(0.0, 1.0),
        y_range=Range1d(0.0, 1.0),
        **more,
    )
    plot.lod_threshold = None  # no line is left out while the diagram moves
    plot.toolbar.logo = None
    plot.toolbar.active_scroll = wheel
    plot.toolbar.active_drag = pan
    plot.grid.grid_line_alpha = 0.5
    for axis in plot.axis:
        axis.formatter = BasicTickFormatter(power_limit_low=SMALL)
    plot.outline_line_color = None
    return plot


def _source(name: str, columns: str) -> ColumnDataSource:
    return ColumnDataSource({column: [] for column in columns.split()}, name=name)


def diagram() -> Any:
    """Return the branch diagram."""
    plot = _figure(TALL, "pan wheel box reset save", toolbar_location="above")
    plot.multi_line(
        "xs",
        "ys",
        source=_source("lines", "xs ys color width dash offset"),
        line_color="color",
        line_width="width",
        line_dash="dash",
        line_dash_offset="offset",
    )
    look: dict[str, Any] = {"size": "size", "line_color": "color", "fill_color": "fill"}
    marks = plot.scatter(
        "x",
        "y",
        source=_source("marks", "x y color fill marker size words"),
        marker="marker",
        line_width=1.5,
        **look,
    )
    # marks that move with the slider are painted alone, without the branches
    ring: dict[str, Any] = {"fill_color": None, "line_color": BLACK, "level": "overlay"}
    plot.scatter("x", "y", source=_source("now", "x y"), size=11, line_width=1.5, **ring)
    plot.scatter("x", "y", source=_source("chosen", "x y"), size=18, line_width=3, **ring)
    dotted: dict[str, Any] = {"line_color": "#555555", "line_dash": [2, 3]}
    plot.add_layout(Span(name="rule", dimension="height", level="overlay", **dotted))
    plot.add_tools(
        HoverTool(renderers=[marks], tooltips="@words{safe}", point_policy="follow_mouse")
    )
    plot.js_on_event(Tap, CustomJS(code="window.pwscont.tapped(cb_obj.x, cb_obj.y)"))
    return plot


def strip() -> Any:
    """Return the number of solutions and the balance over the parameter."""
    plot = _figure(STRIP, "pan wheel reset", toolbar_location=None)
    plot.yaxis.ticker = BasicTicker(min_interval=1, num_minor_ticks=0, desired_num_ticks=4)
    plot.yaxis.formatter = NumeralTickFormatter(format="0")
    plot.yaxis.axis_label = "number"
    balance = plot.line(
        "x", "y", source=_source("balance", "x y"), color=SLIP, line_width=1.5, line_dash=[5, 3]
    )
    count = plot.line("x", "y", source=_source("count", "x y"), color=BLACK, line_width=2)
    plot.scatter("x", "y", source=_source("single", "x y size"), color=BLACK, size="size")
    endless = plot.ray(
        "x", 0, 0, 1.5707963, source=_source("endless", "x"), color=BLACK, line_dash=[1, 3]
    )
    rule: dict[str, Any] = {"line_color": "#555555", "level": "overlay"}
    plot.add_layout(Span(name="strip rule", dimension="height", **rule))
    words = {"solutions": count, "balance (sum of signs)": balance, "∞: a vertical piece": endless}
    _add_legend(plot, words, "strip legend")
    plot.js_on_event(Tap, CustomJS(code="window.pwscont.move(cb_obj.x)"))
    return plot


def _add_legend(plot: Any, words: dict[str, Any], name: str) -> None:
    """Add a legend above a diagram, outside of the data."""
    items = [LegendItem(label=label, renderers=[drawn]) for label, drawn in words.items()]
    small: dict[str, Any] = {"border_line_color": None, "padding": 0, "spacing": 14, "margin": 2}
    legend = Legend(items=items, orientation="horizontal", name=name, **small)
    legend.label_text_font_size = "11px"
    plot.add_layout(legend, "above")


def body_figure(body: dict[str, Any]) -> Any:
    """Return the picture of the deformed body."""
    left, right, bottom, top = body["extent"]
    slender = (top - bottom) / ((right - left) or 1.0)
    plot = figure(
        sizing_mode="stretch_width",
        height=int(min(max(COLUMN * slender + BARS, LEAST), TALL)),
        match_aspect=True,
        tools="pan,wheel_zoom,reset,save",
        toolbar_location="above",
    )
    # ranges follow these corners only, so that bodies of all solutions have one scale
    corners = plot.scatter([left, right], [bottom, top], size=0, alpha=0.0)
    for drawn_range in (plot.x_range, plot.y_range):
        drawn_range.renderers = [corners]
        drawn_range.range_padding = 0.05
    plot.axis.visible, plot.grid.visible = False, False
    plot.outline_line_color, plot.toolbar.logo = None, None
    plot.toolbar.active_scroll = None
    plot.patches("xs", "ys", source=_source("obstacles", "xs ys"), color="#cccccc")
    _draw_elements(plot, body)
    held = {"color": "#555555", "size": 5, "marker": "square"}
    plot.scatter("x", "y", source=_source("held", "x y"), **held)
    many = len(body["contact"])
    size = 9.0 if many <= 20 else 6.0
    for name, fill in (("stick", BLACK), ("no contact", "white")):
        look: dict[str, Any] = {"line_color": BLACK, "fill_color": fill, "size": size}
        plot.scatter("x", "y", source=_source(name, "x y"), **look)
    plot.scatter(
        "x",
        "y",
        source=_source("slip", "x y angle"),
        angle="angle",
        marker="triangle",
        color=SLIP,
        size=1.3 * size,
    )
    return plot


def _draw_elements(plot: Any, body: dict[str, Any]) -> None:
    mapper = LinearColorMapper(palette=Blues256[::-1], low=0.0, high=body["strongest"])
    lines = 0.5 if len(body["corners"]) <= 1500 else 0.0
    shaded = plot.patches(
        "xs",
        "ys",
        source=_source("elements", "xs ys shade"),
        fill_color={"field": "shade", "transform": mapper},
        line_color="#777777" if body["components"] else BLACK,
        line_width=lines if body["components"] else 1.0,
    )
    if body["components"]:
        bar = shaded.construct_color_bar(
            title=body["labels"][0],
            title_text_font_size="11px",
            height=10,
            padding=4,
            ticker=BasicTicker(desired_num_ticks=4),
            formatter=PrintfTickFormatter(format="%.2g"),
        )
        plot.add_layout(bar, "below")


def curves_figure(body: dict[str, Any]) -> Any:
    """Return pressure, shear and friction bound along the boundary."""
    plot = _figure(CURVES, "pan wheel reset", toolbar_location=None)
    plot.toolbar.active_scroll = None
    plot.xaxis.axis_label, plot.yaxis.axis_label = body["labels"][1:]
    bound = plot.multi_line(
        "xs", "ys", source=_source("bound", "xs ys"), color=BOUND, line_dash=[5, 3]
    )
    drawn = {}
    for name, color, marker in (("pressure", PRESSURE, "circle"), ("shear", SHEAR, "square")):
        drawn[name] = plot.multi_line(
            "xs", "ys", source=_source(name, "xs ys"), color=color, line_width=2
        )
        dots = _source(f"{name} at nodes", "x y")
        plot.scatter("x", "y", source=dots, color=color, size=5, marker=marker)
    _add_legend(plot, drawn | {"friction bound": bound}, "curves legend")
    return plot


STATIC = Path(__file__).parent / "static"
PROGRAMS = ("data.js", "solutions.js", "body.js", "diagram.js", "page.js")


def page_of(records: dict[str, Any], title: str) -> str:
    """Return the HTML page from records and title."""
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
    """Return records as JSON that may stand within an HTML page."""
    return json.dumps(records, ensure_ascii=False).replace("<", "\\u003c")


def _read(name: str) -> str:
    return (STATIC / name).read_text(encoding="utf-8")
