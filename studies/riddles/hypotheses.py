"""What might have been so, as a robot and a schedule of commands; and how each of it runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from studies.inputs import CYCLES
from studies.riddles.cameras import REST
from workbench.motion import Commands, Motion, load_motion
from workbench.recording.take import Take
from workbench.robot import EffectSpec, RobotModel, data_file
from workbench.simulation import Job, SimulationConfig, simulate_batch

Progress = Callable[[str, float | None], None]
LEAD = REST + 0.013
"""Rest before the first command of each run [s], a little longer than what the cameras see of it."""


@dataclass(frozen=True)
class Hypothesis:
    """One explanation. says: in a sentence. effects, servos: what is different about the robot. sends: what is different about
    what is sent. floors: also run with the step halved and quartered, and in the other contact model."""

    name: str
    says: str
    effects: tuple[EffectSpec, ...] = ()
    servos: Mapping[str, float] = field(default_factory=dict)
    sends: Callable[[Commands], Commands] | None = None
    floors: bool = False

    def robot(self, nominal: RobotModel) -> RobotModel:
        """The robot as it would be."""
        return replace(nominal.with_servos(self.servos), effects=(*nominal.effects, *self.effects))


@dataclass(frozen=True)
class Run:
    """One hypothesis, simulated. finer: step halved and quartered; other_contact: hydroelastic. Both may be empty."""

    hypothesis: Hypothesis
    take: Take
    finer: tuple[Take, ...] = ()
    other_contact: tuple[Take, ...] = ()

    @property
    def name(self) -> str:
        """The hypothesis's."""
        return self.hypothesis.name


@dataclass(frozen=True)
class Setting:
    """How all hypotheses of a study are run. seconds: after the first command."""

    seconds: float
    motion: Motion
    cycles: int = CYCLES
    base: str = "free"
    time_step: float = 1e-3
    contact: str = "point"

    def config(self) -> SimulationConfig:
        """Without contact forces, whose sampling costs time."""
        return SimulationConfig(time_step=self.time_step, base=self.base, contact=self.contact, contact_period=0.0,
                                log_period=2e-3)


def walk() -> Motion:
    """The ROBOTIS walk of the thesis's figure 3.4."""
    return load_motion(data_file("robotis_walk.csv"))


def job_of(h: Hypothesis, nominal: RobotModel, setting: Setting) -> Job:
    """One run of one hypothesis."""
    commands = setting.motion.commands(setting.cycles)
    if h.sends is not None:
        commands = h.sends(commands)
    return Job(h.robot(nominal), setting.config(), commands, setting.seconds, LEAD, name=h.name)


def run_all(hypotheses: Sequence[Hypothesis], nominal: RobotModel, setting: Setting, progress: Progress,
            floors: bool = True) -> dict[str, Run]:
    """Runs of all hypotheses by name. floors: False leaves out finer steps and the other contact model everywhere."""
    jobs: list[tuple[str, str, Job]] = []
    for h in hypotheses:
        jobs.append((h.name, "take", job_of(h, nominal, setting)))
        if not (h.floors and floors):
            continue
        steps = [replace(setting, time_step=setting.time_step / k) for k in (2, 4)]
        jobs += [(h.name, "finer", job_of(h, nominal, s)) for s in steps]
        if setting.base == "free":
            jobs.append((h.name, "other", job_of(h, nominal, replace(setting, contact="hydroelastic"))))
    takes = simulate_batch([job for *_, job in jobs], n_jobs=1, progress=lambda n, of: progress("simulating", n / of))
    by: dict[str, dict[str, list[Take]]] = {h.name: {"take": [], "finer": [], "other": []} for h in hypotheses}
    for (name, kind, _), take in zip(jobs, takes):
        by[name][kind].append(take)
    return {h.name: Run(h, by[h.name]["take"][0], tuple(by[h.name]["finer"]), tuple(by[h.name]["other"])) for h in hypotheses}
