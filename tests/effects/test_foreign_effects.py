"""Effects of other packages: an error in one is reported in a line that names package, entry point, effect and hook."""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.command import refused
from tests.plug_in import install_plug_in
from workbench.api.doctor import examine
from workbench.effects.apply import physics_of
from workbench.effects.base import Effect
from workbench.effects.foreign import check_effect
from workbench.effects.registry import ENTRY_POINT_GROUP, known_effects
from workbench.files import InputError
from workbench.identify.rollouts.key import rollout_code
from workbench.robot import EffectSpec, puppy_model

SOUND = """
from workbench.effects.base import Effect, Parameter
class Cap(Effect):
    name, layer, places = "speed_cap", "actuator", ("joint",)
    parameters = (Parameter("speed", "deg/s", 0.0, 900.0, 300.0),)
    def sentence(self, spec):
        return "slow"
    def law(self, law, columns, values):
        return law.nothing_of_that_name
EFFECT = Cap()
"""
Install = Callable[[str], None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Install]:
    def write(text: str) -> None:
        install_plug_in(tmp_path, monkeypatch, "cap_bad", text, ENTRY_POINT_GROUP, "cap = cap_bad:EFFECT")
        known_effects.cache_clear()

    yield write
    monkeypatch.undo()
    known_effects.cache_clear()


@pytest.mark.parametrize(("old", "new", "said"), [
    ("EFFECT = Cap()", "", "cannot be loaded (AttributeError"),
    ("from workbench", "import no_such_module\nfrom workbench", "cannot be loaded (ModuleNotFoundError"),
    ("EFFECT = Cap()", "EFFECT = 3", "expected Effect, got int"),
    ('"actuator"', '"servo"', "effect 'speed_cap': layer: expected one of timing"),
    ('("joint",)', '("joints",)', "places: expected a tuple of some of joint"),
    ("0.0, 900.0", "900.0, 0.0", "parameter 'speed': expected low"), ("def sentence", "def other", "sentence: is missing"),
    ('name, layer, places = "speed_cap", ', "layer, places = ", "name: is missing"),
])
def test_a_broken_package_is_named_in_one_line(install: Install, tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str,
                                               new: str, said: str) -> None:
    install(SOUND.replace(old, new))
    (tmp_path / "model.yaml").write_text("format: 1\neffects: [{effect: backlash, where: [flm], parameters: {gap: 1}}]\n")
    line = refused(capsys, "inspect", str(tmp_path / "model.yaml"))
    assert "package cap-bad, entry point cap of workbench.effects: " in line
    assert said in line
    (check,) = [c for c in examine(tmp_path / "none").checks if c.name == "effects"]
    assert check.state == "broken"
    assert said in check.found


def test_what_a_hook_raises_names_effect_and_hook_in_other_processes_too(install: Install) -> None:
    install(SOUND)
    effect = pickle.loads(pickle.dumps(known_effects()["speed_cap"]))
    model = puppy_model().with_effect(EffectSpec("speed_cap", ("flm",), {"speed": 100.0}))
    with pytest.raises(InputError, match=r"package cap-bad.*effect 'speed_cap', hook law: AttributeError"):
        physics_of(model)
    with pytest.raises(InputError, match="hook law"):
        effect.law(None, None, {})
    assert effect.sentence(None) == "slow"


def test_the_doctor_lists_what_is_installed(install: Install, tmp_path: Path) -> None:
    install(SOUND)
    found = {c.name: c.found for c in examine(tmp_path / "none").checks}
    assert "cap from package cap-bad" in found["effects"]
    assert "speed_cap" in found["effects"]
    assert "joint_log" in found["recording formats"]
    assert "AX-12A" in found["servo families"]


def test_the_workbenchs_own_effects_pass() -> None:
    for effect in known_effects().values():
        check_effect(effect)
    with pytest.raises(InputError, match="not known, or its package is not installed"):
        physics_of(puppy_model().with_effect(EffectSpec("no_such")))
    assert isinstance(known_effects()["backlash"], Effect)


def test_rollouts_are_remembered_by_the_effects_code_too(install: Install, tmp_path: Path) -> None:
    without = rollout_code.__wrapped__()
    install(SOUND)
    installed = rollout_code.__wrapped__()
    (tmp_path / "cap_bad.py").write_text(SOUND.replace("slow", "slower"))
    assert len({without, installed, rollout_code.__wrapped__()}) == 3
