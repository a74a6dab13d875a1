"""How a servo log was logged, found before anything is fitted, and the resulting corrections."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench.recording.recording import Recording
from workbench.recording.servo_log.goal_stamps import with_sent_times
from workbench.recording.servo_log.held_sensor import at_their_stamps, refresh_of


def as_logged(r: Recording) -> Recording:
    """The recording with `notes` on the findings. Positions of a sensor that is refreshed more slowly than it is read are
    moved to the times at which they were measured, and goals to those at which they were sent."""
    channels, notes = dict(r.channels), list(r.notes)
    for joint in r.joints:
        position = channels.get(f"position.{joint}")
        if position is None or len(position) != len(r.time):
            continue
        refresh = refresh_of(r.time, position)
        if refresh is not None:
            age, row = 1e3 * float(np.mean(refresh.ages(r.time))), 1e3 * float(np.median(np.diff(r.time)))
            channels[f"position.{joint}"] = at_their_stamps(r.time, position, refresh)
            notes.append(f"position.{joint} is refreshed every {1e3 * refresh.period:.3f} ms and read every {row:.2f} ms, so "
                         f"that it is {age:.1f} ms old on average: brought to its stamps")
    return with_sent_times(replace(r, channels=channels, notes=tuple(notes)))
