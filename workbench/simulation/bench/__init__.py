"""The figures of the README, measured side by side in one run.

They live here because simulation is the lowest room that sees all that is measured, the reader of recordings included; the verb
only prints. MuJoCo and its robot are in the source tree alone (studies/): without them that figure is left out, with the reason.
"""

from workbench.simulation.bench.figure import Figure
from workbench.simulation.bench.run import run_bench

__all__ = ["Figure", "run_bench"]
