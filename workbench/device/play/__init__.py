"""Playing a motion on the robot from the host: ramps, timing, what stops it, and the joint log."""

from workbench.device.play.log import finish_log
from workbench.device.play.options import Played, PlayOptions
from workbench.device.play.perform import perform, preflight
from workbench.device.play.plan import ReadingPlan, reading_plan
from workbench.device.play.player import play
from workbench.device.play.watch import Reaction, Watch, WatchOptions

__all__ = [
    "PlayOptions",
    "Played",
    "Reaction",
    "ReadingPlan",
    "Watch",
    "WatchOptions",
    "finish_log",
    "perform",
    "play",
    "preflight",
    "reading_plan",
]
