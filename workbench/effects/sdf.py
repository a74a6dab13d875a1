"""Changes to a robot's SDF, as text that any Drake project can load."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from workbench.robot import InputError


class SdfRobot:
    """An SDF file in memory; each method changes one thing about the robot. Lengths m, angles rad."""

    def __init__(self, path: Path) -> None:
        self.path = path
        ElementTree.register_namespace("drake", "http://drake.mit.edu")
        self._tree = ElementTree.parse(path)
        model = self._tree.getroot().find("model")
        if model is None:
            raise InputError(path, "no <model>: effects that change the robot's build need an SDF file")
        self._model = model

    def text(self) -> str:
        """The changed SDF, its relative files made absolute."""
        for uri in self._model.iter("uri"):
            if uri.text and "://" not in uri.text and not Path(uri.text).is_absolute():
                uri.text = str((self.path.parent / uri.text).resolve())
        return ElementTree.tostring(self._tree.getroot(), encoding="unicode")
