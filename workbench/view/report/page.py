"""One page that holds a whole result: headline, key numbers, text, figures, tables, 3D replay, provenance."""

from __future__ import annotations

import base64
import gzip
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from pathlib import Path
from typing import TypeAlias

from matplotlib.figure import Figure

from workbench.files.reading import read_text, write_whole
from workbench.robot.model import RobotModel
from workbench.view.figures import encode
from workbench.view.report.curves import Curves, curves_html


@dataclass(frozen=True)
class Text:
    """A paragraph for each blank-line-separated part; `code`, **bold** and [words](file.ext), a link to a
    file in the page's folder, are supported, nothing else."""

    text: str


@dataclass(frozen=True)
class Table:
    """Rows under a header. Cells are shown as they are; columns in which all cells look like numbers are right-aligned. emphasis:
    rows to stress, by index."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""
    emphasis: Sequence[int] = ()


@dataclass(frozen=True)
class Picture:
    """A figure and the sentence that says what to see in it."""

    figure: Figure
    caption: str = ""


@dataclass(frozen=True)
class Replay:
    """A 3D replay that `write_replay` wrote, inside the page; it loads on request. poster: shown until then and in print,
    ideally a `film_strip`."""

    path: str | Path
    caption: str = ""
    poster: Figure | None = None


@dataclass(frozen=True)
class Details:
    """Parts folded away under one line."""

    summary: str
    parts: Sequence[Part]


Part: TypeAlias = Text | Table | Picture | Replay | Curves | Details


@dataclass(frozen=True)
class Section:
    """A heading and the parts under it."""

    title: str
    parts: Sequence[Part]


@dataclass(frozen=True)
class Provenance:
    """Where a result comes from: the model's hash, random seed, wall time [s], and any other named facts."""

    model_sha256: str = ""
    seed: int | None = None
    seconds: float | None = None
    more: Sequence[tuple[str, str]] = ()

    @staticmethod
    def of(model: RobotModel, seed: int | None = None, seconds: float | None = None, **more: str) -> Provenance:
        """The provenance of a result that was computed with `model`."""
        return Provenance(model.sha256, seed, seconds, tuple(more.items()))

    def items(self) -> list[tuple[str, str]]:
        """Names and values, versions of workbench and Drake first."""
        out = [("workbench", _version("drake-workbench")), ("drake", _version("drake"))]
        if self.model_sha256:
            out.append(("model", self.model_sha256[:12]))
        if self.seed is not None:
            out.append(("seed", str(self.seed)))
        if self.seconds is not None:
            out.append(("computed in", f"{self.seconds:.1f} s"))
        return [*out, *self.more]


@dataclass
class Report:
    """A page under construction. headline: the result in one sentence. key_numbers: (label, value, remark), few.

    Example: `Report("Walk", "It walks 9 % too far.").add(Section("Path", [Picture(body_path(take))])).write("report.html")`
    """

    title: str
    headline: str
    summary: str = ""
    key_numbers: Sequence[tuple[str, str, str]] = ()
    provenance: Provenance = field(default_factory=Provenance)
    sections: list[Section] = field(default_factory=list)

    def add(self, section: Section) -> Report:
        """Appends a section and returns the report, so that calls can be chained."""
        self.sections.append(section)
        return self

    def html(self) -> str:
        """The page; it loads nothing from the network."""
        assets = files("workbench.view").joinpath("assets")
        style = assets.joinpath("report.css").read_text(encoding="utf-8")
        body = [f"<header><p class=kicker>{escape(self.title)}</p><h1>{_inline(self.headline)}</h1>"]
        if self.summary:
            body.append(_render(Text(self.summary)).replace("<p>", "<p class=lead>"))
        body.append("</header>")
        if self.key_numbers:
            body.append(f"<dl class=numbers>{''.join(map(_key_number, self.key_numbers))}</dl>")
        body += [_section(s) for s in self.sections]
        source = "".join(f"<span><b>{escape(name)}</b> {escape(value)}</span>" for name, value in self.provenance.items())
        body.append(f"<footer>{source}</footer>")
        used = {"replay": "report.js", "curves": "curves.js"}
        scripts = [assets.joinpath(name).read_text(encoding="utf-8") for kind, name in used.items()
                   if any(f'<figure class="{kind}"' in part for part in body)]
        return (
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"<title>{escape(self.title)}</title>\n<style>\n{style}</style></head>\n<body><main>\n"
            + "\n".join(body) + "\n</main>" + "".join(f"\n<script>\n{script}</script>" for script in scripts) + "</body></html>\n"
        )

    def write(self, path: str | Path) -> Path:
        """Writes the page atomically; InputError if `path` cannot be written or a replay cannot be read."""
        return write_whole(path, self.html())


def _section(section: Section) -> str:
    anchor = re.sub(r"[^a-z0-9]+", "-", section.title.lower()).strip("-")
    parts = "\n".join(map(_render, section.parts))
    return f'<section id="{anchor}"><h2>{escape(section.title)}</h2>\n{parts}</section>'


def _render(part: Part) -> str:
    match part:
        case Text(text):
            return "".join(f"<p>{_inline(p)}</p>" for p in re.split(r"\n\s*\n", text.strip()) if p)
        case Table():
            return _table(part)
        case Picture(figure, caption):
            return f"<figure><div class=wide>{_image(figure, caption)}</div>{_caption(caption)}</figure>"
        case Replay():
            return _replay(part)
        case Curves():
            return curves_html(part)
        case Details(summary, parts):
            return f"<details><summary>{_inline(summary)}</summary>{''.join(map(_render, parts))}</details>"
    raise TypeError(f"expected a part of a report, got {type(part).__name__}")


def _table(table: Table) -> str:
    columns = list(zip(*table.rows)) if table.rows else [()] * len(table.header)
    if any(len(row) != len(table.header) for row in table.rows):
        raise ValueError(f"expected {len(table.header)} cells in every row of the table '{table.caption}'")
    right = [bool(cells) and all(_NUMBER.fullmatch(c.strip()) for c in cells) for cells in columns]

    def row(cells: Sequence[str], tag: str, kind: str = "") -> str:
        inside = "".join(f"<{tag}{' class=n' if r else ''}>{_inline(c)}</{tag}>" for c, r in zip(cells, right))
        return f"<tr{kind}>{inside}</tr>"

    rows = "".join(row(cells, "td", ' class="stress"' if i in table.emphasis else "") for i, cells in enumerate(table.rows))
    return (f"<figure><div class=table><table><thead>{row(table.header, 'th')}</thead><tbody>{rows}</tbody></table></div>"
            f"{_caption(table.caption)}</figure>")


def _replay(replay: Replay) -> str:
    packed = base64.b64encode(gzip.compress(read_text(replay.path).encode(), compresslevel=6, mtime=0)).decode()
    poster = "" if replay.poster is None else _image(replay.poster, replay.caption)
    label = escape(replay.caption or "3D replay")
    return (f'<figure class="replay"><div class="stage" data-label="{label}">{poster}'
            '<button type="button">&#9654;&ensp;play in 3D</button></div>'
            f'<script type="application/gzip">{packed}</script>{_caption(replay.caption)}</figure>')


def _image(figure: Figure, alt: str) -> str:
    encoded = encode(figure)
    width = round(96 * figure.get_figwidth())
    return (f'<img alt="{escape(_plain(alt))}" style="width:{width}px" '
            f'src="data:{encoded.mime};base64,{base64.b64encode(encoded.content).decode()}">')


def _key_number(item: tuple[str, str, str]) -> str:
    label, value, remark = item
    return f"<div><dt>{_inline(label)}</dt><dd>{_inline(value)}</dd><dd class=remark>{_inline(remark)}</dd></div>"


def _caption(text: str) -> str:
    return f"<figcaption>{_inline(text)}</figcaption>" if text else ""


def _inline(text: str) -> str:
    out = re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text, quote=False))
    out = re.sub(r"\[([^\]]+)\]\(([\w.-]+\.\w+)\)", r'<a href="\2">\1</a>', out)
    return re.sub(r"\*\*([^*]+)\*\*", r"<b>\1</b>", out)


def _plain(text: str) -> str:
    return re.sub(r"[`*]", "", text)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


_NUMBER = re.compile(
    r"|[–—]|[<>≤≥±≈]?\s*[+\-−]?[\d.,]+(\s*(±\s*[\d.,]+|×|%|[a-zA-Z°/²³µ]{1,6}|to\s*[+\-−]?[\d.,]+))*"
)
"""What counts as a number in a table's cell: blank, a dash, or digits with sign, tolerance and unit."""
