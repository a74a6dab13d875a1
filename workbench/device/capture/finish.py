"""From the journal to the take: a Motive CSV that every reader of takes reads, and the losses on the network."""

from __future__ import annotations

import datetime
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workbench.device.capture.journal import read_journal
from workbench.device.capture.packets import Frame
from workbench.device.capture.stream import Counts, Echo, Stream
from workbench.files import InputError
from workbench.files.reading import write_whole
from workbench.recording.body_track import BodyTrack
from workbench.recording.formats.motive_write import write_motive
from workbench.types import Array

DRIFT_AFTER = 10.0
"""Seconds of echoes from which the clock's drift is estimated: 0.1 ms over them are 10 ppm, less than the difference of two
crystals."""
FEWEST = 2
"""Frames of a take: fewer have no rate."""
SAME = 50e-6
"""Drift over a whole take [s] below which the nominal rate is taken for the measured one."""


@dataclass(frozen=True)
class ServerClock:
    """The server's clock less this machine's monotonic one: offset [s] at the first frame, known within +-`within` [s] (half the
    shortest round trip); drift [s/s]. NaN where the server answers no echo (before NatNet 3.0)."""

    offset: float
    within: float
    drift: float


@dataclass(frozen=True)
class Capture:
    """A finished recording. rate: of mid-exposures on the server's clock [Hz]. first_time: mid-exposure of the first frame there
    [s]; first_host: the same on this machine's monotonic clock. worst_time: largest error of frame/rate as a time [s]."""

    take: Path
    counts: Counts
    rate: float
    first_time: float
    first_host: float
    worst_time: float
    clock: ServerClock
    gaps: Mapping[str, float]
    problems: tuple[str, ...]


def finish(journal: str | Path, take: str | Path, ended: str = "", motive_recording: str | None = None,
           until: float | None = None) -> Capture:
    """Writes the take (CSV) and NAME.capture.json in the same folder, complete or not at all; frames that did not come, and
    bodies that were not seen, are blank cells. ended: why it ended early. until: host time [s] after which frames are left out.
    InputError where the journal holds no frame."""
    journal, take = Path(journal), Path(take)
    stream, frames, soonest = Stream(), {}, math.inf  # type: tuple[Stream, dict[int, Frame], float]
    for arrival, data in read_journal(journal):
        frame = stream.take(arrival, data)
        if frame is not None:
            frames[frame.number] = frame
            soonest = min(soonest, arrival - frame.time)
    if len(frames) < FEWEST or not stream.about:
        raise InputError(journal, f"{len(frames)} whole frames; expected {FEWEST} or more")
    counts = stream.counts()
    numbers = np.array(sorted(frames))
    times = np.array([frames[n].time for n in numbers.tolist()])
    rate, worst = _rate(numbers, times)
    first = float(times[0])
    clock = _clock(stream.echoes, first)
    first_host = first - clock.offset if math.isfinite(clock.offset) else first + soonest
    if until is not None:
        frames = {n: f for n, f in frames.items() if first_host + (f.time - first) <= until}
        if len(frames) < FEWEST:
            raise InputError(journal, f"{len(frames)} whole frames before the recording's end; expected {FEWEST} or more")
    bodies = _tracks(frames, stream.names, counts.first, max(frames))
    gaps = {name: float(np.mean(np.isnan(track.p[:, 0]))) for name, track in bodies.items()}
    note = stream.about
    began = datetime.datetime.fromisoformat(note["utc"]) + datetime.timedelta(seconds=first_host - note["arrival"])
    capture = Capture(take, counts, rate, first, first_host, worst, clock, gaps, _problems(counts, gaps, worst, clock, ended))
    local = began.astimezone()
    write_motive(take, bodies, rate, take_name=take.stem, first_frame=0, metadata={
        "Capture Start Time": local.strftime("%Y-%m-%d %I.%M.%S.%f")[:-3] + local.strftime(" %p")})
    write_whole(take.with_suffix(".capture.json"), json.dumps(
        _report(capture, stream, began, motive_recording), indent=1, allow_nan=False) + "\n")
    return capture


def _rate(numbers: NDArray[np.int64], times: Array) -> tuple[float, float]:
    """Rate of the frames on the server's clock [Hz], and the largest deviation of a frame's time from number/rate [s]."""
    n, t = numbers - numbers[0], times - times[0]
    slope = float(np.polyfit(n, t, 1)[0])
    if not slope > 0:
        raise InputError(None, "the server's time stamps do not increase")
    nominal = round(1 / slope)
    rate = float(nominal) if nominal and abs(n[-1] * (slope - 1 / nominal)) < SAME else float(1 / slope)
    return rate, float(np.max(np.abs(t - n / rate)))


def _tracks(frames: Mapping[int, Frame], names: Mapping[int, str], first: int, last: int) -> dict[str, BodyTrack]:
    span = last - first + 1
    ids = sorted({body.id for frame in frames.values() for body in frame.bodies})
    p, quat, error = np.full((len(ids), span, 3), np.nan), np.full((len(ids), span, 4), np.nan), np.full((len(ids), span), np.nan)
    row = {number: i for i, number in enumerate(ids)}
    for number, frame in frames.items():
        k = number - first
        for body in frame.bodies:
            if body.tracked:
                i = row[body.id]
                x, y, z, w = body.quat
                p[i, k], quat[i, k], error[i, k] = body.p, (w, x, y, z), body.error
    return {names.get(number, f"body_{number}"): BodyTrack(p[i], quat[i], error[i]) for number, i in row.items()}


def _clock(echoes: list[Echo], first: float) -> ServerClock:
    """The clock, from the quarter of the echoes with the shortest round trips; a drift where they span `DRIFT_AFTER`."""
    if not echoes:
        return ServerClock(math.nan, math.nan, 0.0)
    sent, received, server = np.array([(e.sent, e.received, e.server) for e in echoes]).T
    trip, offset = received - sent, server - (received + sent) / 2
    best = trip <= np.quantile(trip, 0.25) + 1e-6
    drift, at = 0.0, float(np.mean(offset[best]))
    if best.sum() > 2 and np.ptp(server[best]) > DRIFT_AFTER:
        drift, at = (float(x) for x in np.polyfit(server[best] - first, offset[best], 1))
    return ServerClock(at, float(trip[best].min() / 2), drift)


def _problems(counts: Counts, gaps: Mapping[str, float], worst: float, clock: ServerClock, ended: str) -> tuple[str, ...]:
    out = [ended] if ended else []
    if counts.lost or counts.broken:
        out.append(f"{counts.lost} frames lost on the network and {counts.broken} broken, of {counts.last - counts.first + 1}")
    if worst > 1e-3:
        out.append(f"the frames are not evenly spaced: up to {1000 * worst:.1f} ms off their rate")
    if not math.isfinite(clock.offset):
        out.append("the server answered no echo request: its clock is estimated from the earliest arrival of a frame")
    unseen = [name for name, share in gaps.items() if share == 1]
    if unseen:
        out.append(f"never seen: {', '.join(unseen)}")
    return tuple(out)


def _report(c: Capture, stream: Stream, began: datetime.datetime, motive_recording: str | None) -> dict[str, Any]:
    info = stream.info
    assert info is not None
    return {
        "format": 1, "take": c.take.name,
        "server": {"application": info.application, "application_version": info.application_version,
                   "version": list(info.version), "link": stream.about["link"]},
        "frames": asdict(c.counts), "rate": c.rate, "worst_time": c.worst_time, "gaps": dict(c.gaps),
        "first_frame": {"server_time": c.first_time, "host_monotonic": c.first_host, "utc": began.isoformat()},
        "clock": asdict(c.clock) if math.isfinite(c.clock.offset) else None, "motive_recording": motive_recording,
        "problems": list(c.problems), "broken_packets": [data.hex() for data in stream.broken],
    }
