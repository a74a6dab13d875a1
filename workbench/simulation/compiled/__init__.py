"""The station's discrete step compiled: the same law as Drake's, without its bookkeeping, for the jobs that it covers."""

from workbench.simulation.compiled.lanes.together import compile_lanes
from workbench.simulation.compiled.station import CompiledJob, compile_station, covers, run_compiled
from workbench.simulation.compiled.stepped import CompiledSteppedRun
from workbench.simulation.compiled.tables import NotCoveredError

__all__ = ["CompiledJob", "CompiledSteppedRun", "NotCoveredError", "compile_lanes", "compile_station", "covers", "run_compiled"]
