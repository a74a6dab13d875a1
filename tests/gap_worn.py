"""A small arm whose joint `three` is stiffer than its model says, recorded, registered and ready to be searched."""

from tests.gap_sessions import record_arm
from workbench.compare.compare_session import roll_out, run_of
from workbench.compare.session import load_session
from workbench.compare.session_takes import read_takes, register_takes
from workbench.identify.preparation import gather
from workbench.simulation import SimulationConfig

NOMINAL, HIDDEN = 0.06, 0.14
CONFIG = SimulationConfig(settle=0.5, time_step=2e-3, contact_period=0)


def gathered(folder, friction):
    record_arm(folder, friction=friction)
    session = load_session(folder / "session.yaml")
    takes, _ = read_takes(session)
    rollouts = roll_out([run_of(t) for t in takes], CONFIG, n_jobs=1)
    registered, _ = register_takes(session, takes, {t.spec.name: r.nominal for t, r in zip(takes, rollouts)})
    return session, gather(registered, {t.spec.name: r for t, r in zip(takes, rollouts)})
