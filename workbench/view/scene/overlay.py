"""Title, legend, switches and time bar laid over a meshcat page."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from html import escape
from importlib.resources import files

from workbench.view.figures.errors import LIMIT
from workbench.view.figures.heat import DARKEST, gradient
from workbench.view.figures.style import ACCENT, RECORDED, SIMULATED
from workbench.view.scene.marks import Marks

LIBRARY = "library"
"""Path under which a page has each mesh once, unseen."""


@dataclass(frozen=True)
class Copy:
    """A mesh of the library, shown at `path`; colours: rgba of its parts."""

    path: str
    mesh: str
    colours: list[list[float]]


@dataclass(frozen=True)
class Legend:
    """Content of the page's overlay: names of the robots, the forces' scale [N per m of arrow], the grid's spacing [m],
    the first frame's time since the first command [s], when poses were commanded [s], the middle [m] and half width [m] of
    the floor that is walked on, and the optional sideways offset of the recorded robot [m]; meshes to copy; marks of
    errors."""

    title: str
    simulated: str
    recorded: str | None
    newtons_per_metre: float | None
    grid: float
    start: float
    poses: list[float]
    middle: tuple[float, float]
    reach: float
    aside: float
    copies: list[Copy]
    marks: list[Marks] = field(default_factory=list)


def with_overlay(html: str, legend: Legend) -> str:
    """The meshcat page with the overlay in it and our title."""
    page = html.replace("<title>Drake MeshCat</title>", f"<title>{escape(legend.title)}</title>", 1)
    head, body_end, tail = page.rpartition("</body>")
    if not body_end:
        raise ValueError("expected a meshcat page with a body")
    return f"{head}{_overlay(legend)}{body_end}{tail}"


def _overlay(legend: Legend) -> str:
    alone = legend.recorded is None
    rows = [_switch("simulated traces/simulated", "#BBBBBB" if alone else SIMULATED,
                    legend.simulated)]
    if not alone:
        rows.append(_switch("recorded traces/recorded", RECORDED, str(legend.recorded)))
    if legend.newtons_per_metre is not None:
        rows.append(_switch("forces", ACCENT, f"contact force, 10 N is {1000 / legend.newtons_per_metre:.0f} cm"))
    rows += [_switch(" ".join(p.strip("/") for p in m.paths), gradient(), m.label, m.shown) for m in legend.marks]
    if legend.marks:
        rows.append(f'<div class="wb-heat"><span>≤ {LIMIT:g}×</span><b style="background:{gradient()}"></b>'
                    f"<span>≥ {DARKEST:g}× noise</span></div>")
    template = files("workbench.view").joinpath("assets/replay.html").read_text(encoding="utf-8")
    copies = [[c.path, c.mesh, [[round(x, 3) for x in rgba] for rgba in c.colours]] for c in legend.copies]
    settings = {
        "start": round(legend.start, 6), "poses": [round(t, 4) for t in legend.poses],
        "middle": [round(x, 4) for x in legend.middle], "reach": round(legend.reach, 4), "aside": round(legend.aside, 3),
        "library": LIBRARY, "copies": copies,
        "marks": [path for m in legend.marks for path in m.paths],
    }
    return (
        template.replace("%TITLE%", escape(legend.title))
        .replace("%ROWS%", "\n".join(rows))
        .replace("%GRID%", f"{100 * legend.grid:.0f} cm")
        .replace("%BESIDE%", "hidden" if alone else "")
        .replace("%SETTINGS%", json.dumps(settings))
    )


def _switch(paths: str, colour: str, text: str, on: bool = True) -> str:
    box = f'<input type="checkbox"{" checked" if on else ""} data-paths="{escape(paths)}">'
    return f'<label>{box}<i style="background:{colour}"></i><span>{escape(text)}</span></label>'
