"""Runs the cells of the documentation's notebook in order, and checks the errors that it prints."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

NOTEBOOK = Path(__file__).parents[2] / "docs" / "examples" / "notebook" / "tutorial_arm.ipynb"


def _shown(source: str, names: dict[str, Any]) -> Any:
    """Runs a cell; returns its output in a notebook, the value of an expression in its last line."""
    tree = ast.parse(source, str(NOTEBOOK))
    last = tree.body[-1]
    if not isinstance(last, ast.Expr):
        exec(compile(tree, str(NOTEBOOK), "exec"), names)
        return None
    exec(compile(ast.Module(tree.body[:-1], []), str(NOTEBOOK), "exec"), names)
    return eval(compile(ast.Expression(last.value), str(NOTEBOOK), "eval"), names)


def test_the_notebook_runs_and_shows_that_friction_closes_the_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(NOTEBOOK.parent)
    content = json.loads(NOTEBOOK.read_text())
    cells = [cell for cell in content["cells"] if cell["cell_type"] == "code"]
    assert all(not cell["outputs"] for cell in cells)
    names: dict[str, Any] = {"__name__": "__main__"}
    shown = [_shown("".join(cell["source"]), names) for cell in cells]
    assert "<" in shown[0]._repr_html_()
    assert shown[2]["nominal"] > 1.0
    assert shown[2]["with friction"] < 0.2
    assert isinstance(shown[3], Figure)
