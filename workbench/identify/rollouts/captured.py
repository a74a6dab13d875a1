"""Channels of rollouts of captured takes, read from the compiled station's log: the numbers of `TakeEvidence.observe` without a
take, and outside Python's lock. Rollouts that the compiled station does not cover are observed as takes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from workbench.cache import Cache
from workbench.compare.channels import ACROSS, BODY, body_channels, joint_of
from workbench.effects.apply import apply_to_measurement
from workbench.identify.problem import TakeEvidence
from workbench.recording import quaternions as quat
from workbench.recording.mocap.observe import frame_turn
from workbench.recording.mocap.tracks import SeenJoint, seen_joints, turn_quaternion
from workbench.recording.recording import Measurement
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import SimulationConfig
from workbench.simulation.batch import run_job, simulate_stream
from workbench.simulation.cluster import on_cluster
from workbench.simulation.compiled import NotCoveredError
from workbench.simulation.compiled.seen_bodies import SeenBodies, seen_bodies
from workbench.simulation.compiled.station import CompiledJob, announced
from workbench.simulation.compiled.turns import joint_turns
from workbench.simulation.job import Job
from workbench.types import Array


class Rollout(NamedTuple):
    """A job, the take that it imitates, and the robot as cameras observe it: some effects change the measurement alone."""

    evidence: TakeEvidence
    model: RobotModel
    job: Job


Made = dict[tuple[int, SimulationConfig], CompiledJob]
"""Stations of rollouts that are played together, by the model (`id`) and the configuration."""


def channels_stream(rollouts: Sequence[Rollout], n_jobs: int) -> Iterator[Array]:
    """Channels (N, c) of each rollout as its take would have shown them, in their order, each as soon as it is there."""
    if on_cluster():
        yield from map(_observe, rollouts, simulate_stream([r.job for r in rollouts], n_jobs))
    elif n_jobs == 1 or len(rollouts) == 1:
        made: Made = {}
        yield from (_channels(r, compiled_for(r, made)) for r in rollouts)
    else:
        yield from _in_threads(rollouts, n_jobs)


def seen_channels(rollout: Rollout) -> Array | None:
    """Channels (N, c) from the compiled station; None where it does not know the robot, or cameras did not see the take."""
    compiled = compiled_for(rollout, {})
    return None if compiled is None else _play_compiled(rollout, compiled)


def _in_threads(rollouts: Sequence[Rollout], n_jobs: int) -> Iterator[Array]:
    made: Made = {}
    covered = [compiled_for(r, made) for r in rollouts]
    others = iter(simulate_stream([r.job for r, c in zip(rollouts, covered) if c is None], n_jobs))
    with ThreadPoolExecutor(n_jobs) as threads:
        started = [None if c is None else threads.submit(_channels, r, c) for r, c in zip(rollouts, covered)]
        try:
            for rollout, channels in zip(rollouts, started):
                yield _observe(rollout, next(others)) if channels is None else channels.result()
        finally:
            threads.shutdown(cancel_futures=True)


def _observe(rollout: Rollout, take: Take) -> Array:
    return rollout.evidence.observe(take, rollout.model)


def _channels(rollout: Rollout, compiled: CompiledJob | None) -> Array:
    channels = None if compiled is None else _play_compiled(rollout, compiled)
    return _observe(rollout, run_job(rollout.job)) if channels is None else channels


def compiled_for(rollout: Rollout, made: Made) -> CompiledJob | None:
    """A rollout's job on the compiled station; None where this does not know the robot, or cameras did not see the take. made:
    stations of the other rollouts, to which this one's is added: a robot's takes share its arrays and the rest it settles in."""
    e, job = rollout.evidence, rollout.job
    captured = e.take.recorded.zeroed and e.take.measurement.pivots and job.times is not None and job.start is None
    if not captured or job.config.engine == "drake":
        return None
    key = (id(job.model), job.config)
    try:
        compiled = made[key].of(job) if key in made else CompiledJob(job)
    except NotCoveredError:
        return None
    made.setdefault(key, compiled)
    followed = set(e.joints) <= {j.name for j in _looked_at(e, rollout.model)}
    return compiled if followed or not compiled.between else None


def _play_compiled(rollout: Rollout, compiled: CompiledJob) -> Array | None:
    e, model = rollout.evidence, rollout.model
    m = apply_to_measurement(e.take.measurement, model)
    links = [model.rigid_bodies[asset] for asset in m.pivots]
    frames = e.take.recorded.time - m.starts_at
    try:
        bodies = seen_bodies(compiled, announced(lambda: compiled.log(compiled.schedule())), links, frames)
    except NotCoveredError:
        return None
    joints = _looked_at(e, model)
    assets = list(m.pivots)
    frame = np.array([turn_quaternion(frame_turn(a, m), -m.yaw) if a in m.frames else [1.0, 0, 0, 0] for a in assets])
    turns = np.empty((len(frames), len(joints), 4))
    parents = np.array([-1 if j.parent is None else j.parent for j in joints], dtype=np.int64)
    children = np.array([j.child for j in joints], dtype=np.int64)
    axes = np.array([j.axis for j in joints]).reshape(-1, 3)
    joint_turns(bodies.turns, bodies.turns_rest, frame, parents, children, axes, turns)
    out = np.full((len(frames), len(e.channels)), np.nan)
    column = {j.name: i for i, j in enumerate(joints)}
    for i, channel in enumerate(e.channels):
        joint, axis = joint_of(channel), channel.partition(ACROSS)[2]
        if joint in column:
            out[:, i] = turns[:, column[joint], 1 + "xyz".index(axis) if axis else 0]
        elif joint not in BODY and not axis:  # of a joint between bodies that are not tracked, the rollout's own angle
            k = model.joints.index(joint)
            out[:, i] = bodies.q[:, k] - bodies.q_rest[k]
    if BODY[0] in e.channels:
        body = _body(e, model, m, bodies, assets, frame)
        out[:, [e.channels.index(c) for c in BODY]] = body
    return out


_joints: Cache[list[SeenJoint]] = Cache(32)  # robots and sets of tracked bodies


def _looked_at(e: TakeEvidence, model: RobotModel) -> list[SeenJoint]:
    """Joints between bodies that cameras track; found once for the same robot and bodies, whatever its effects."""
    kinematics, assets, base = model.kinematics, tuple(e.take.measurement.pivots), e.take.spec.base
    key = (id(kinematics), tuple(model.rigid_bodies.items()), model.base, assets, base)
    return _joints.get(key, lambda: seen_joints(assets, model, base)[0], held=kinematics)


def _body(e: TakeEvidence, model: RobotModel, m: Measurement, bodies: SeenBodies, assets: list[str], frame: Array) -> Array:
    """Channels of the body (N, 6): path and rotation of the base since rest, of which a turned frame makes others."""
    since_rest = quat.multiply(bodies.quat_WB, quat.conjugate(bodies.quat_rest))
    p_WB = bodies.p_WB - bodies.p_rest + np.array([0.0, 0.0, m.origin[2]])
    root = next((a for a in assets if model.rigid_bodies[a] == model.base), None)
    if root in m.frames:
        assert root is not None
        seen_turn = quat.multiply(since_rest, frame[assets.index(root)])
        p_WB = p_WB + (quat.matrix(since_rest) - quat.matrix(seen_turn)) @ m.pivots[root]
        since_rest = seen_turn
    recorded = e.take.recorded
    return body_channels(Take(e.name, "simulation", recorded.time, (), np.empty((len(p_WB), 0)), starts_at=m.starts_at, p_WB=p_WB,
                              quat_WB=since_rest))
