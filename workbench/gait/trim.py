"""A certified gait made to go straight on the robot that a recording shows."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from workbench.files import InputError
from workbench.gait.certificate import NAME, Certificate, read_certificate
from workbench.gait.certify import Certified, CertifyOptions, OtherEngine, certify
from workbench.gait.ensemble import Ensemble
from workbench.gait.examine import Examiner
from workbench.gait.machine import GaitMachine
from workbench.gait.request import Request
from workbench.gait.requirements import curvature, drift
from workbench.gait.shape import GaitShape
from workbench.gait.straighten import PROBED, turn_response, turned_by
from workbench.gait.table import GaitTable, gait_table
from workbench.gait.turning import RecordedTurn, TurnEstimate, recorded_turn
from workbench.recording.formats.read import read_recording
from workbench.recording.mocap.angles import base_row, in_world
from workbench.recording.mocap.mending import repaired
from workbench.recording.mocap.tracks import check_assets
from workbench.recording.quaternions import matrix
from workbench.robot import RobotModel
from workbench.types import Progress

SEED = 2_000_000
"""Of the trimmed motion's robots, apart from those of searches and certificates."""


@dataclass(frozen=True)
class Gait:
    """A certified gait: its shape in numbers, and the request it was certified for."""

    shape: GaitShape
    request: Request
    certificate: Certificate


@dataclass(frozen=True)
class Trimmed:
    """recorded: turning in the recording. estimate: of the robot after it, before it was trimmed. turn: the change of `turn` that
    was made [rad]. request: that of the trimmed motion; table and certified: the motion."""

    recorded: RecordedTurn
    estimate: TurnEstimate
    turn: float
    request: Request
    table: GaitTable
    certified: Certified

    @property
    def expected(self) -> float:
        """Heading by distance that the robot should be left with [rad/m]."""
        bias, gain = self.estimate.mean
        return float(bias + gain * self.turn)

    @property
    def problem(self) -> str:
        """Which limit the trimmed motion breaks, in a line; empty where it keeps all."""
        if self.certified.certificate.kept:
            return ""
        broken = max((m for m in self.certified.certificate.margins if not m.advice), key=lambda m: m.use)
        return f"the trimmed motion breaks a limit: {broken}"


def read_gait(motion: str | Path, model: RobotModel) -> Gait:
    """The gait beside whose motion its certificate lies. InputError where there is none, it belongs to another robot, or
    shape or request are missing from it."""
    at = Path(motion).parent / NAME
    certificate = read_certificate(at)
    if certificate.model_sha256 != model.sha256:
        raise InputError(at, f"it was made for another robot ({certificate.model_sha256[:12]}) than this ({model.sha256[:12]})")
    try:
        return Gait(GaitShape.from_plain(certificate.shape), Request.from_plain(certificate.asked), certificate)
    except (KeyError, TypeError, ValueError):
        expected = "expected a gait's shape and request, as `workbench optimize` writes them; make the gait again"
        raise InputError(at, expected) from None


def turn_in(recording: str | Path, model: RobotModel, period: float) -> RecordedTurn:
    """Turning in a recording of the base's rigid body. period: of the gait's cycle [s]. InputError where it cannot be read, does
    not show the base, or is too short."""
    read = read_recording(recording)
    if read.sensing != "mocap":
        raise InputError(recording, f"expected a recording by cameras, got {read.kind}: servos cannot measure the robot's path")
    check_assets(read, model)
    tracks = repaired(read, model)
    base = base_row(tracks, model)
    if base is None:
        raise InputError(recording, f"expected the rigid body of '{model.base}', got {', '.join(tracks.assets)}")
    p, q = in_world(tracks, 0.0, np.zeros(3))
    ahead = matrix(q[base])[..., 0]
    return recorded_turn(tracks.time, p[base][:, :2], np.arctan2(ahead[:, 1], ahead[:, 0]), period, str(recording))


def trim(machine: GaitMachine, gait: Gait, recorded: RecordedTurn, ensemble: Ensemble, options: CertifyOptions,
         progress: Progress, other: tuple[str, OtherEngine] | None = None) -> Trimmed:
    """Changes `turn` by what straightens the recorded robot, and certifies the motion: on the nominal robot it turns to the other
    side, and its draws scatter about that. InputError for a gait that cannot be steered."""
    request, shape = gait.request, gait.shape
    progress("how the gait answers to its turn", None)
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        others = [request.on_slope(r) for r in ensemble.draws(machine.model, PROBED, SEED + 1, Path(folder))]
        response = turn_response(machine, request, shape, others)
    excess = recorded.heading - curvature(replace(request, bias=0.0))
    estimate = TurnEstimate.before(request.limits.spread, response.gain(recorded.speed), response.sd)
    estimate = estimate.after(0.0, excess, recorded.sd)
    turned = turned_by(machine, request, shape, estimate.turn)
    table, nominal = gait_table(machine, turned), request.on_slope(machine.model)
    examiner = Examiner(nominal, machine.legs, table, replace(options, draw_seconds=options.seconds))
    (walked,) = examiner.robots([nominal])  # as the certificate walks: another length or start turns by degrees more
    trimmed = replace(request, bias=request.bias - drift(request, walked.measure))
    known = gait.certificate.provenance
    origin = {"workbench": version("drake-workbench"), "drake": version("drake"), "ensemble": Path(ensemble.source).name,
              "ensemble_sha256": ensemble.sha256, "seed": known.get("seed", 0), "rollouts": 0, "searched in": 0.0,
              "trimmed": {"turn rad": turned.turn - shape.turn, "heading deg/m": float(np.degrees(recorded.heading)),
                          "standard deviation deg/m": float(np.degrees(recorded.sd)), "metres": recorded.metres,
                          "of": dict(gait.certificate.tables)}}
    with tempfile.TemporaryDirectory(prefix="workbench-") as folder:
        draws = ensemble.draws(machine.model, options.draws, SEED, Path(folder))
        certified = certify(machine, trimmed, table, draws, options, progress, origin, other)
    return Trimmed(recorded, estimate, turned.turn - shape.turn, trimmed, table, certified)
