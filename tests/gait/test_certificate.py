"""Certificates: bound to their table and robot, and asked for by export."""

import hashlib
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from tests.command import refused, succeeds
from workbench.cli.check import check_table_of
from workbench.device.tables.table_file import encode_table, table_file
from workbench.files import InputError
from workbench.gait.certificate import NAME, check_certificate, has_mark, read_certificate
from workbench.gait.certify import CertifyOptions, Examination, certify
from workbench.gait.ensemble import load_ensemble
from workbench.gait.examine import Examiner
from workbench.gait.machine import GaitMachine
from workbench.gait.optimize import write_gait
from workbench.gait.request import Request
from workbench.gait.second_engine import AS_IT_IS, Condition, conditions, margins
from workbench.gait.shape import GaitShape
from workbench.gait.table import gait_table
from workbench.gait.trim import read_gait, trim
from workbench.gait.turning import RecordedTurn
from workbench.motion import Motion, load_motion, save_motion
from workbench.robot import EffectSpec, puppy_model
from workbench.view.figures.gait import draw_ranges

SHAPE = GaitShape("trot", (1, 1), 8, 2.2, stride=0.06, duty=0.6, lift=0.02, crouch=0.04, lead=1.0)
OPTIONS = CertifyOptions(seconds=1.0, draw_seconds=1.0, draws=2, checked=0, floor_seconds=0.3, step=2e-3, compared_seconds=0.3,
                         variants=("2 ms", "1 ms"), n_jobs=1, watched=8, trimmed=1)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A gait with its certificate, in a folder."""
    folder = tmp_path_factory.mktemp("gait")
    machine = GaitMachine(puppy_model())
    request = Request()
    lax = replace(request.limits, drift=10.0, spread=10.0, trimmed=5.0, aside=5.0, rms=1.3, torque=2.0, lift=1e-6,
                  slip=5.0, slip_on_draws=9.0)
    request = replace(request, limits=lax)  # any gait will do here
    table = gait_table(machine, SHAPE)
    draws = load_ensemble().draws(machine.model, 2, 7, folder)
    provenance = {"seed": 7, "rollouts": 0, "searched in": 0.0, "ensemble_sha256": "x"}
    same = ("itself", lambda model, commands, seconds: _again(model, commands, seconds))
    certified = certify(machine, request, table, draws, OPTIONS, lambda what, done: None, provenance, same)
    write_gait(folder, table, certified)
    return folder, machine, table, certified


def _again(model, commands, seconds):
    from workbench.simulation import Job, SimulationConfig, simulate_batch

    return simulate_batch([Job(model, SimulationConfig(time_step=2e-3), commands, seconds, 0.3)])[0]


def test_what_the_robots_refuse_is_known_before_the_rest_is_simulated(made, monkeypatch, tmp_path):
    _, machine, table, certified = made
    request = replace(certified.request, limits=replace(certified.request.limits, tilt=1e-4))
    draws = load_ensemble().draws(machine.model, 2, 7, tmp_path)
    examination = Examination(machine, request, table, draws, replace(OPTIONS, watched=0, trimmed=0), lambda what, done: None, {})
    with monkeypatch.context() as m:
        m.setattr(Examiner, "variant", lambda *_: pytest.fail("simulated although the robots refuse the gait"))
        assert examination.refusal is not None
        assert examination.refusal.name.startswith("tilt")
    rest = examination.finish().certificate
    assert not rest.kept
    assert examination.refusal in rest.margins
    assert [m.name for m in rest.margins if m.name not in ("speed of the worse half of draws",)] == [
        m.name for m in certified.certificate.margins if m.name not in ("way back to its cycle", "drift after 3 recorded metres")
        and "engine" not in m.name and "itself" not in m.name]


@pytest.mark.parametrize("text", [
    "", "[]", "[1, 2]", "7", "null", "true", '"certificate"', "{}", '{"format": 2}', '{"format": 1}',
    '{"format": 1, "sha256": []}', "[" * 4000, '{"format": 1' + "0" * 40 + "}", '{"format": NaN}', "{'format': 1}"])
def test_what_is_no_certificate_is_refused_in_plain_words(tmp_path, text):
    (tmp_path / NAME).write_text(text)
    with pytest.raises(InputError) as caught:
        read_certificate(tmp_path / NAME)
    assert str(caught.value).startswith(str(tmp_path / NAME))
    assert "Error" not in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [[], [3], 3, "three", None, {}, {"a": 1}, [{"a": 1}]])
def test_a_field_of_another_type_is_named(made, tmp_path, value):
    """Even where the digest is right, as of a file that another program wrote."""
    content = made[3].certificate.to_json()
    for name in ("kept", "request", "tables", "margins", "nominal", "draws", "ways", "cycle", "shape", "provenance"):
        if isinstance(value, dict) and isinstance(content[name], dict) and name not in ("nominal", "ways", "cycle"):
            continue
        if (name, value) in (("request", "three"), ("cycle", {})):
            continue
        (tmp_path / NAME).write_text(json.dumps(_digested({**content, name: value})))
        with pytest.raises(InputError, match=f"{name} has other content") as caught:
            read_certificate(tmp_path / NAME)
        assert "Error" not in str(caught.value)


def _digested(content):
    rest = {k: v for k, v in content.items() if k != "sha256"}
    return {**rest, "sha256": hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()}


def test_says_what_there_is_to_say(made):
    folder, machine, table, certified = made
    c = read_certificate(folder / NAME)
    assert c.draws["count"] == 2
    assert {m.where for m in c.margins if m.name == "RMS torque"} == set(machine.model.joints)
    assert {m.name for m in c.margins} >= {"range", "moving speed", "reach", "self-contact", "RMS torque", "torque-speed line",
                                           "supply current", "tilt", "falls", "bus time", "poses",
                                           "way back to its cycle"}
    assert set(c.floor["speed"]) == {"2 ms", "1 ms"}
    assert c.other_engine["speed kept"] == pytest.approx(1.0, abs=1e-3)  # the other engine is this one
    assert set(c.other_engine["conditions"]) == {c.name for c in conditions()}
    assert c.other_engine["largest speed apart"] < 0.02
    assert {m.name for m in c.margins} >= {"tilt over draws", "slip over draws", "foot clearance over draws", "engines apart"}
    assert c.draws["speed m/s"][1] is None  # of two draws there is no 5th percentile
    back = c.cycle.back
    assert {"from neutral", "at once", "a pose got lost", "a push to the left", "from another table"} <= set(back)
    assert all(n is not None and n <= 5 for n in back.values())
    assert c.cycle.heading < 1.0
    assert c.ways.rest.off < 6
    assert GaitShape.from_plain(json.loads((folder / NAME).read_text())["shape"]) == table.shape
    assert Request.from_plain(c.asked) == certified.request
    assert c.draws["straightened"]["robots"] == 1
    assert abs(c.draws["straightened"]["after 3 metres deg/m RMS"]) < 6.0
    assert "a claim about the model" in json.loads((folder / NAME).read_text())["claim"]
    assert c.as_text() == certified.certificate.as_text()


def test_is_bound_to_its_table_and_its_robot(made, tmp_path):
    folder, machine, _, _ = made
    assert has_mark(folder / "gait.csv")
    check_certificate(folder / "gait.csv", load_motion(folder / "gait.csv"), machine.model)
    cycle_alone = tmp_path / "gait.csv"
    save_motion(Motion.from_table(load_motion(folder / "gait.csv").as_table().part("loop")), cycle_alone)
    (tmp_path / NAME).write_text((folder / NAME).read_text())
    with pytest.raises(InputError, match="another table's"):  # certified from power-on, not the cycle thrown in at full speed
        check_certificate(cycle_alone, load_motion(cycle_alone), machine.model)
    other = replace(machine.model, ground=replace(machine.model.ground, friction=0.4))
    with pytest.raises(InputError, match="another robot"):
        check_certificate(folder / "gait.csv", load_motion(folder / "gait.csv"), other)


def other_goal(path):
    lines = path.read_text().splitlines()
    cells = lines[5].split(",")
    cells[2] = str(float(cells[2]) + 2.0)
    path.write_text("\n".join([*lines[:5], ",".join(cells), *lines[6:]]) + "\n")


def tampered(folder, to, change):
    for name in ("gait.csv", NAME):
        (to / name).write_text((folder / name).read_text())
    change(to)
    return to / "gait.csv"


@pytest.mark.parametrize(("change", "said"), [
    (lambda f: (f / NAME).unlink(), "the certificate is missing"),
    (lambda f: (f / NAME).write_text("{}"), "not a certificate"),
    (lambda f: (f / NAME).write_text((f / NAME).read_text().replace('"seed": 7', '"seed": 8')),
     "was changed after it was written"),
    (lambda f: other_goal(f / "gait.csv"), "another table's"),
])
def test_export_refuses_what_has_no_valid_certificate_unless_forced(made, tmp_path, capsys, change, said):
    path = tampered(made[0], tmp_path, change)
    assert said in refused(capsys, "export", str(path), "--out", str(tmp_path / "out"), "--cycles", "1")
    assert not (tmp_path / "out").exists()
    succeeds(capsys, "export", str(path), "--out", str(tmp_path / "out"), "--cycles", "1", "--force")
    assert (tmp_path / "out/pos.txt").is_file()


@pytest.mark.parametrize("verb", [("run",), ("run", "--upload"), ("play", "--port", "virtual"), ("flash", "--dry-run")])
def test_no_verb_moves_a_robot_by_what_lacks_its_certificate(made, tmp_path, capsys, verb):
    path = tampered(made[0], tmp_path, lambda f: (f / NAME).unlink())
    said = refused(capsys, verb[0], str(path), *verb[1:], "--out", str(tmp_path / "out"))
    assert "the certificate is missing; use --force to override" in said
    assert not (tmp_path / "out").exists()


def test_a_broken_limit_is_named(made, tmp_path):
    folder, machine, _, certified = made
    broken = replace(certified.certificate, kept=False, margins=tuple(
        replace(m, use=1.5) if (m.name, m.where) == ("RMS torque", "flm") else m for m in certified.certificate.margins))
    (tmp_path / NAME).write_text(broken.as_text())
    (tmp_path / "gait.csv").write_text((folder / "gait.csv").read_text())
    with pytest.raises(InputError, match="it reports a broken limit: RMS torque, flm"):
        check_certificate(tmp_path / "gait.csv", load_motion(tmp_path / "gait.csv"), machine.model)


def test_the_page_shows_few_draws_and_what_happened_to_them(made):
    certificate = made[3].certificate  # of two draws there are no percentiles
    figure = draw_ranges(certificate)
    assert [a.get_yticklabels()[0].get_text() for a in figure.axes] == [
        k for k, v in certificate.draws.items() if isinstance(v, list) and k not in ("quantiles", "incidents")]
    fell = {**certificate.draws, "incidents": [{"draw": 1, "robot": "friction 0.30", "what": "fell"}]}
    assert len(draw_ranges(replace(certificate, draws=fell)).axes) == len(figure.axes)


def test_the_robotis_walk_needs_none(capsys, tmp_path):
    from workbench.robot import data_file

    said = succeeds(capsys, "export", str(data_file("robotis_walk.csv")), "--out", str(tmp_path / "walk"), "--cycles", "1")
    assert "wrote" in said


def test_what_is_not_known_is_null_in_the_file_and_comes_back_as_nan(made, tmp_path):
    certificate = made[3].certificate
    blind = replace(certificate, nominal=replace(certificate.nominal, slip=float("nan"), power=np.float64(30.5)))
    (tmp_path / NAME).write_text(blind.as_text())
    assert json.loads(blind.as_text())["nominal"]["slip m/s"] is None
    again = read_certificate(tmp_path / NAME)
    assert math.isnan(again.nominal.slip)
    assert again.nominal.power == 30.5
    assert (again.ways, again.cycle) == (certificate.ways, certificate.cycle)


def test_engines_that_disagree_anywhere_break_the_certificate(made):
    """The other engine has its floor at another friction than it says, which one friction alone would not show."""
    _, machine, table, _ = made
    request = Request()
    examiner = Examiner(machine.model, machine.legs, table, OPTIONS)
    slick = Condition("friction 0.3", (EffectSpec("ground_friction", (), {"friction": 0.3}),))

    def other(model, commands, seconds):
        wrong = any(e.effect == "ground_friction" for e in model.effects)
        told = model.with_effect(EffectSpec("ground_friction", (), {"friction": 0.05})) if wrong else model
        return _again(told, commands, seconds)

    pairs = {c.name: examiner.elsewhere(other, c) for c in (Condition(AS_IT_IS), slick)}
    good, broken = margins(request, "other", {AS_IT_IS: pairs[AS_IT_IS]}, 0.05), margins(request, "other", pairs, 0.05)
    assert all(m.use <= 1 for m in good)
    assert broken[0].use > 1
    assert broken[0].where == "friction 0.3, in other"


def test_a_binary_table_is_checked_against_the_certificate_beside_it(made, tmp_path, capsys):
    folder, machine, _, _ = made
    succeeds(capsys, "export", str(folder / "gait.csv"), "--out", str(tmp_path), "--cycles", "1", "--force")
    table = str(tmp_path / "motion.table")
    check_table_of("flash", table, machine.model, force=False)
    (tmp_path / NAME).write_text((tmp_path / NAME).read_text().replace('"seed": 7', '"seed": 8'))
    with pytest.raises(InputError, match="was changed after it was written; use --force"):
        check_table_of("flash", table, machine.model, force=False)
    other = load_motion(folder / "gait.csv").as_table()
    other = replace(other, dwells_ms=other.dwells_ms + 1)
    (tmp_path / "motion.table").write_bytes(encode_table(table_file(other, machine.model)))
    (tmp_path / NAME).write_text((folder / NAME).read_text())
    with pytest.raises(InputError, match="another table's"):
        check_table_of("flash", table, machine.model, force=False)


def test_a_binary_table_without_a_certificate_has_its_limits_checked(made, tmp_path):
    _, machine, table, _ = made
    whole = table.whole
    whole.goals[0, whole.joints.index("flm")] = 1000
    (tmp_path / "motion.table").write_bytes(encode_table(table_file(whole, machine.model)))
    with pytest.raises(InputError, match="beyond the joint's limit"):
        check_table_of("flash", str(tmp_path / "motion.table"), machine.model, force=False)


def test_a_trimmed_gait_is_certified_for_the_robot_that_was_recorded(made, tmp_path):
    folder, machine, table, _ = made
    gait = read_gait(folder / "gait.csv", machine.model)
    assert gait.shape == table.shape
    quick = replace(OPTIONS, draws=0, watched=0, variants=("2 ms",))
    recorded = RecordedTurn(math.radians(12), math.radians(1), 1.0, 8, 0.2)
    done = trim(machine, gait, recorded, load_ensemble(), quick, lambda what, done: None)
    assert done.turn < 0
    assert abs(done.expected) < math.radians(2)
    nominal = done.certified.certificate.nominal  # it does not turn by itself, so that it goes the other way
    assert abs(nominal.heading) < 3  # relative to the request, which includes the opposite turn
    assert nominal.turning < -1
    assert done.request.bias == pytest.approx(math.radians(12), abs=math.radians(4))
    assert "trimmed for a robot that turns by" in done.certified.certificate.request
    write_gait(tmp_path, done.table, done.certified)
    again = read_gait(tmp_path / "gait.csv", machine.model)
    assert again.request == done.request
    assert again.shape.turn == pytest.approx(gait.shape.turn + done.turn)
