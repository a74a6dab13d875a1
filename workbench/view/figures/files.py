"""Figures as files: encoded, or saved."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from workbench.files import InputError
from workbench.files.reading import write_whole
from workbench.view.figures.style import in_house_style

LARGEST_SVG = 200_000
"""A larger figure [bytes] is kept as SVG only if the PNG would be larger still."""


@dataclass(frozen=True)
class EncodedFigure:
    """A figure's file: its MIME type and content."""

    mime: str
    content: bytes


@in_house_style
def encode(figure: Figure) -> EncodedFigure:
    """SVG, or PNG if the SVG is large and the PNG smaller. The same figure gives the same bytes."""
    _settle(figure)
    svg = EncodedFigure("image/svg+xml", _print_figure(figure, "svg"))
    if len(svg.content) <= LARGEST_SVG:
        return svg
    png = EncodedFigure("image/png", _print_figure(figure, "png"))
    return min(svg, png, key=lambda encoded: len(encoded.content))


@in_house_style
def save_figure(figure: Figure, path: str | Path) -> Path:
    """Writes .svg, .png or .pdf atomically; InputError for another ending, or if the file cannot be written."""
    path = Path(path)
    kind = path.suffix.removeprefix(".").lower()
    if kind not in ("svg", "png", "pdf"):
        raise InputError(path, "expected a figure's name to end in .svg, .png or .pdf")
    _settle(figure)
    return write_whole(path, _print_figure(figure, kind))


def _settle(figure: Figure) -> None:
    """Lays the figure out once; the layout engine would do so again at each drawing, and move axes by a tenth of a pixel. With an
    engine, even one that does nothing, a figure is drawn twice for a file."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)


def _print_figure(figure: Figure, kind: str) -> bytes:
    out = io.BytesIO()
    metadata = {"svg": {"Date": None}, "png": {"Software": None}, "pdf": {"CreationDate": None}}[kind]
    figure.savefig(out, format=kind, metadata=metadata)
    return out.getvalue()
