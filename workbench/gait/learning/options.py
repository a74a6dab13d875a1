"""Ranges of a learner's actions, length of its episodes, and its reward."""

from __future__ import annotations

from dataclasses import dataclass

from workbench.files.option_checks import check_positive, check_whole


@dataclass(frozen=True)
class LearningOptions:
    """Actions, episodes and rewards.

    turn: largest turn of a cycle [rad per stance]; beyond 0.15 the puppy's feet leave their reach. paces: least and largest share
    of the gait's stride in a cycle. offset: largest angle that is added to a goal of a pose [rad]; 0.1 rad move the puppy's foot
    by 1 cm. cycles: of an episode, after the start. time_step: of the simulation [s]; 2 and 1 ms agree to a hundredth in speed.

    The reward of an action is the distance walked along x [cm], less the costs. lateral: for each cm walked to the side. heading:
    for each rad off x and each action [cm]. fall: of a fall [cm], which ends the episode; the puppy walks twice
    as far in an episode. change: for a change of every action from one end of its range to the other [cm].
    """

    turn: float = 0.15
    paces: tuple[float, float] = (0.5, 1.2)
    offset: float = 0.1
    cycles: int = 12
    time_step: float = 2e-3
    lateral: float = 0.5
    heading: float = 0.5
    fall: float = 30.0
    change: float = 0.0

    def __post_init__(self) -> None:
        check_whole(self, cycles=1)
        check_positive(self, "turn", "offset", "time_step")
