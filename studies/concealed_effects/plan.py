"""Which sessions there are, from one seed: quiet ones, named effects alone and together, masks, and physics without a name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from studies.concealed_effects.catalogue import CATALOGUE, HIDEABLE, MOVES, PULLS, TIES, crowded, possible
from studies.concealed_effects.robots import Robot, arm, puppy, quadruped, rig
from studies.other_engine.hidden import OUTSIDE

MAKERS = {"quadruped": quadruped, "puppy": puppy, "arm": arm, "rig": rig}


@dataclass(frozen=True)
class SessionPlan:
    """name: of the session. robot: a key of MAKERS. effects: names, drawn, from none to three. masked: the last one's size is
    found so that the distance walked looks right. seed: of everything else."""

    name: str
    robot: str
    effects: tuple[str, ...]
    masked: bool
    seed: int


def plan_sessions(seed: int, count: int = 100) -> list[SessionPlan]:
    """`count` sessions: of a hundred, 25 quiet, 15 with physics outside the vocabulary (a third of them also with a named
    effect), 20 with one effect, 25 with two, 15 with three; half of those with two or more masked.

    Effects are dealt from a shuffled deck, so that each comes up about equally often.
    """
    rng = np.random.default_rng(seed)
    kinds = ["quiet"] * round(0.25 * count) + ["outside"] * round(0.15 * count) + ["two"] * round(0.25 * count) + [
        "three"] * round(0.15 * count)
    kinds += ["one"] * (count - len(kinds))
    several = np.flatnonzero([k in ("two", "three") for k in kinds])
    with_two = len(several) + len(range(0, kinds.count("outside"), 3))
    masks = set(rng.permutation(several)[: (with_two + 1) // 2])
    named, unnamed = _deck(HIDEABLE, rng), _deck(OUTSIDE, rng)
    plans: list[SessionPlan] = []
    order = rng.permutation(count)
    walkers = ("quadruped", "quadruped", "quadruped", "quadruped", "puppy")
    for k, kind in enumerate(kinds):
        masked = k in masks
        # The masked walk; of the others, a quarter log their joints.
        robot = str(rng.choice(walkers) if masked or rng.uniform() > 0.25 else rng.choice(["arm", "rig"]))
        effects: list[str] = []
        if kind == "outside":
            effects = _deal(unnamed, _some(robot), [], 1, True)
        wanted = {"one": 1, "two": 2, "three": 3, "outside": int(sum(p.effects[:1] != () and p.effects[0] in OUTSIDE
                                                                   for p in plans) % 3 == 0)}.get(kind, 0)
        effects += _deal(named, _some(robot), effects, wanted, False, masked)
        plans.append(SessionPlan(f"s{order[k]:03d}", robot, tuple(effects), masked, int(rng.integers(2**62))))
    return sorted(plans, key=lambda p: p.name)


def dealt_again(plan: SessionPlan, rng: np.random.Generator) -> SessionPlan:
    """The same session with other named effects, as many: some never show together, or cannot mask each other."""
    stay = [e for e in plan.effects if e in OUTSIDE]
    hand = _deal(_deck(HIDEABLE, rng), _some(plan.robot), stay, len(plan.effects) - len(stay), False, plan.masked)
    return replace(plan, effects=(*stay, *hand))


def _some(kind: str) -> Robot:
    """Any robot of its kind: all of a kind can play the same cards."""
    return MAKERS[kind](np.random.default_rng(0))


def _deck(names: tuple[str, ...], rng: np.random.Generator) -> Iterator[list[str]]:
    """One deck, to whose bottom another one goes, shuffled, as soon as a card has run out."""
    deck: list[str] = []
    while True:
        if set(names) - set(deck):
            deck += [str(n) for n in rng.permutation(names)]
        yield deck


def _deal(deck: Iterator[list[str]], robot: Robot, beside: list[str], n: int, outside: bool, masked: bool = False) -> list[str]:
    """Cards that the robot can play beside others; where one is masked, the first moves the body and the last pulls it back."""
    cards, hand = next(deck), list[str]()
    while len(hand) < n:
        allowed = set(possible(robot, outside))
        if masked and len(hand) in (0, n - 1):
            allowed &= set(PULLS) if hand else {*PULLS, *MOVES}
        i = next((i for i, c in enumerate(cards) if c in allowed and not _too_alike(c, hand)
                  and not crowded(robot, [*beside, *hand, c])), None)
        if i is None:
            cards = next(deck)
            continue
        hand.append(cards.pop(i))
        cards = next(deck)
    return hand


def _too_alike(card: str, hand: list[str]) -> bool:
    return card in hand or any(frozenset((card, other)) in TIES for other in hand)


assert all(e in CATALOGUE for e in (*HIDEABLE, *OUTSIDE))
