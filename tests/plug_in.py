"""A package of somebody else's, on the path without pip."""

from pathlib import Path

import pytest


def install_plug_in(folder: Path, monkeypatch: pytest.MonkeyPatch, module: str, text: str, group: str, entry: str) -> None:
    """Puts a module with this text into a folder on the path, and an entry point of a group: "name = module:object"."""
    (folder / f"{module}.py").write_text(text)
    info = folder / f"{module}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module.replace('_', '-')}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{group}]\n{entry}\n")
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(__import__("sys").modules, module, raising=False)
