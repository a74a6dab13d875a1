"""The emulated controller is an extra; where it is not installed one line says so."""

from __future__ import annotations

from argparse import Namespace
from typing import cast

import pytest

from workbench.cli import bus_options
from workbench.files import InputError
from workbench.simulation.virtual_robot import VirtualRobot


def test_without_unicorn_one_line_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bus_options, "find_spec", lambda name: None)
    link = bus_options.open_pc_link(Namespace(image="cm530.bin"), cast(VirtualRobot, object()))
    with pytest.raises(InputError, match=r"pip install 'drake-workbench\[emulator\]'"):
        link.__enter__()
