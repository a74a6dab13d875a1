"""Any two files side by side: recordings, motions, rollout tables, in any pairing."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from workbench.compare.compare_session import Run, provenance, roll_out
from workbench.compare.comparison import compare_takes
from workbench.compare.options import COMPARE
from workbench.compare.results import Comparison
from workbench.compare.session import Base, TakeSpec
from workbench.compare.session_takes import ReadTake, RegisteredTake, check_length, readable, register_take
from workbench.files import InputError
from workbench.motion import load_motion
from workbench.motion.commands import Commands
from workbench.recording.formats.file_kind import file_kind
from workbench.recording.formats.rollout_table import load_rollout
from workbench.recording.mocap.tracks import check_assets
from workbench.recording.take import Take
from workbench.robot import RobotModel
from workbench.simulation import SimulationConfig
from workbench.types import Progress, no_progress


def compare_files(a: str | Path, b: str | Path, model: RobotModel, config: SimulationConfig | None = None, *,
                  cycles: int | None = None,
                  base: Base = "free", progress: Progress = no_progress, n_jobs: int = 2) -> Comparison:
    """Compares two files; a motion is first played `cycles` times on `model`, its base free or fixed.

    Both are aligned at their starts: a rollout's start is known; a recording is registered against the other file, or, if both
    are recordings, the first by its own first motion and the second against it. In the result a recording is the "recorded" side,
    whichever argument it was; of two recordings, motions or rollouts, A is. The numerical floor and the contact spread are known
    only if the other side is a motion. InputError names the file that does not fit.
    """
    began = time.monotonic()
    config = config or SimulationConfig(engine="drake")
    model.check_base(floating=base == "free")
    kinds = file_kind(a), file_kind(b)
    if kinds[1] == "recording" and kinds[0] != "recording":
        a, b, kinds = b, a, (kinds[1], kinds[0])
    files = Path(a), Path(b)
    made_by = {"recorded": str(a), "simulated": str(b)}
    recording = _read(files[0], model, base) if kinds[0] == "recording" else None
    tables = {i: _table(f, model, "motion" in kinds) for i, (f, kind) in enumerate(zip(files, kinds)) if kind == "rollout"}
    runs = {i: _run(f, model, cycles, base, recording) for i, (f, kind) in enumerate(zip(files, kinds)) if kind == "motion"}
    if recording is not None and runs:
        _check_registers(recording, runs[1].commands)
    rollouts = dict(zip(runs, roll_out(list(runs.values()), config, progress=progress, n_jobs=n_jobs)))
    takes = [rollouts[i].nominal if i in rollouts else tables.get(i) for i in range(2)]
    finer = rollouts[1].finer if 1 in rollouts else ()
    other = rollouts[1].other_contact if 1 in rollouts else ()
    progress("comparing", None)
    if recording is not None:
        if kinds[1] == "recording":
            first = _by_first_motion(recording).recorded
            takes = [first, register_take(_read(files[1], model, base), _bridge_gaps(first), None).recorded]
        else:
            predicted = takes[1]
            assert predicted is not None
            commands = recording.commands or predicted.commands
            t = register_take(replace(recording, commands=commands), predicted, None)
            takes = [t.recorded, t.observe(predicted)]
            finer, other = (tuple(t.observe(r) for r in rs) for rs in (finer, other))
    recorded, simulated = takes
    assert recorded is not None
    assert simulated is not None
    result = compare_takes(replace(recorded, name=files[0].stem), replace(simulated, name=files[1].stem), model, finer=finer,
                           other_contact=other)
    return Comparison((result,), provenance=provenance(model, config, time.monotonic() - began) | made_by)


def recorded_take(path: str | Path, model: RobotModel, base: Base = "free") -> Take:
    """A lone recording as a take that starts when its first joint leaves rest. InputError names the file and the problem."""
    return _by_first_motion(_read(Path(path), model, base)).recorded


def _by_first_motion(read: ReadTake) -> RegisteredTake:
    """A recording without commands or a counterpart: it starts when its first joint leaves rest."""
    if read.recording.sensing == "encoders" or read.commands is not None:
        return register_take(read, None, None)
    start = float(read.recording.time[0])
    for _ in range(2):  # zeros are taken before the start, but the start is found from zeroed angles: hence twice
        take = register_take(replace(read, spec=replace(read.spec, starts_at=start)), None, None).recorded
        start = _first_motion(take)
    return register_take(replace(read, spec=replace(read.spec, starts_at=start)), None, None)


def _first_motion(take: Take) -> float:
    """Time [s] at which the first joint has left its first angle by `COMPARE.first_move`, three frames in a row; InputError if
    none does."""
    first = np.nanmedian(take.q[: max(3, len(take) // 100)], axis=0)
    away = np.nan_to_num(np.abs(take.q - first)).max(axis=1) > COMPARE.first_move
    held = np.flatnonzero(away[:-2] & away[1:-1] & away[2:])
    if not len(held):
        raise InputError(take.name, f"start: expected a joint that moves by more than {np.rad2deg(COMPARE.first_move):.0f} deg")
    return float(take.time[held[0]])


def _bridge_gaps(take: Take) -> Take:
    """The take with its gaps filled linearly, so that another take can be aligned with it."""
    q = take.q.copy()
    for column in q.T:
        seen = np.isfinite(column)
        if seen.any():
            column[~seen] = np.interp(take.time[~seen], take.time[seen], column[seen])
    return replace(take, q=np.nan_to_num(q))


def _read(path: Path, model: RobotModel, base: Base) -> ReadTake:
    recording = readable(path, model)
    if recording.rigid_bodies:
        check_assets(recording, model)
    return ReadTake(TakeSpec(path.stem, path, base=base), model, recording, recording.commands)


def _table(path: Path, model: RobotModel, beside_motion: bool) -> Take:
    """A rollout's table that can be compared. beside_motion: with a motion of the model."""
    take = load_rollout(path)
    check_length(path, take.time)
    seen = [j for j, column in zip(take.joints, take.q.T) if np.isfinite(column).any()]
    if not seen:
        raise InputError(path, "no joint has a position to compare with")
    if beside_motion and not set(seen) & set(model.joints):
        raise InputError(path, f"no joint in common with the model ({', '.join(model.joints[:3])}, …); expected takes of one "
                               "robot")
    return take


def _check_registers(read: ReadTake, commands: Commands | None) -> None:
    """InputError, before anything is simulated, for a capture that cannot be brought into the model's frame and clock."""
    try:
        register_take(replace(read, commands=read.commands or commands), None, None)
    except InputError as e:
        raise InputError(read.spec.recording if e.source is None else e.source, e.problem) from None


def _run(path: Path, model: RobotModel, cycles: int | None, base: Base, beside: ReadTake | None) -> Run:
    """The simulation of a motion, as long as the recording with which it is compared."""
    commands = load_motion(path, model).commands(cycles)
    return Run(path.stem, model, commands, commands.end if beside is None else beside.duration, base)
