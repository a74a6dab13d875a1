"""Writes docs/effects.md from the effects themselves: `python -m docs.effects_page`.

Names, units, ranges and relations come from the code. What an effect looks like in a recording, and what it is confused with, is
said here, once for each.
"""

from __future__ import annotations

from pathlib import Path

from workbench.effects.base import Effect, Parameter
from workbench.effects.registry import known_effects
from workbench.robot import EffectSpec
from workbench.robot.files import write_whole

PAGE = Path(__file__).with_name("effects.md")
LAYERS = {
    "timing": "Timing: what reaches the servos, and when", "actuator": "Actuators: what a servo makes of its goal",
    "structure": "Structure: what lies between servo and link", "inertia": "Inertia: masses",
    "ground": "Ground: what the floor and the surroundings do", "measurement": "Measurement: how the robot is seen"}
SEEN: dict[str, tuple[str, str]] = {
    "backlash": ("The link stays behind by the gap wherever the load changes sign; steps of constant size at turning "
                 "points. Under gravity alone it hangs at one side and shows little.",
                 "dead_band, coulomb_friction, joint_compliance"),
    "clock_rate": ("All joints run later and later, in proportion to time.", "timing_drift, where all dwells are alike"),
    "com_shift": ("The robot leans, and walks turn; joints that carry the link err with gravity.",
                  "payload, com_shift of a neighbour"),
    "command_delay": ("The whole curve comes later by a constant; joints at rest show nothing.",
                      "reflected_inertia, a late start"),
    "coulomb_friction": ("Slow reversals stick; the joint stops short of its goal from either side.",
                         "dead_band, load_friction"),
    "dead_band": ("The joint stops short of its goal by a constant angle, with little torque.", "backlash, coulomb_friction"),
    "dropped_command": ("Single poses are missing: the joint goes on as before until the next one.",
                        "joint_stop, coulomb_friction"),
    "foot_friction": ("One foot slips; the robot turns towards or away from it. A robot on a stand shows nothing.",
                      "foot_friction of a neighbour, payload"),
    "friction_asymmetry": ("One direction of travel lags more than the other; at rest the error depends on where it came "
                           "from.",
                           "coulomb_friction, parallel_spring"),
    "ground_friction": ("The robot goes less far, or turns; joints are as they should be.", "ground_tilt, tether_force"),
    "ground_tilt": ("The robot drifts and turns to one side; it leans from the start.", "tether_force"),
    "joint_compliance": ("The link sags with load and swings after steps, where the servo's own sensor is right.",
                         "servo_gain, which sags alike"),
    "joint_stop": ("The curve is cut off flat at an angle.", "dropped_command, where it is met once"),
    "link_length": ("Cameras see two axes at another distance; walks go farther or turn.",
                    "zero_offset of a neighbour, com_shift"),
    "load_friction": ("The error before reversals grows with the load that the joint carries.",
                      "coulomb_friction, under one load"),
    "loose_mount": ("The link turns about an axis that no servo turns.", "marker_frame, when it lies still"),
    "marker_frame": ("A rigid body's rotations come about turned axes; nothing else changes.", "loose_mount, zero_offset"),
    "parallel_spring": ("The error grows with the angle, load or not (a taut cable).", "servo_gain, payload"),
    "payload": ("Joints above it err with gravity and acceleration; walks change.", "com_shift, which has the same moment"),
    "reflected_inertia": ("Fast motions lag and overshoot; slow ones are right.", "command_delay, viscous_friction"),
    "servo_gain": ("Errors under load grow or shrink by a ratio.", "joint_compliance, supply_voltage at one joint"),
    "soft_ground": ("Feet sink in; steps are shorter and softer.", "ground_tilt, com_shift"),
    "speed_order": ("Every joint runs at another joint's speed: right ends, wrong ramps.", "nothing else does this"),
    "stribeck_friction": ("A jump when the joint breaks loose; fast motion is right.", "coulomb_friction"),
    "supply_sag": ("All joints weaken while many work hard at once.", "supply_voltage, under steady work"),
    "supply_voltage": ("All joints are weaker, and slower at full duty.", "thermal_fade in short takes, torque_ceiling"),
    "tether_force": ("The robot is pulled one way, as much at rest as in motion.", "ground_tilt"),
    "thermal_fade": ("All joints weaken slowly through a take.", "supply_voltage in short takes"),
    "timing_drift": ("All joints run later by a step at each pose.", "clock_rate, where all dwells are alike"),
    "torque_ceiling": ("One joint stalls or lags at its peaks of torque; elsewhere it is right.",
                       "supply_voltage, torque_saturation"),
    "torque_saturation": ("One joint lags the more, the more torque it needs.", "torque_ceiling, servo_gain"),
    "viscous_friction": ("The joint lags in proportion to its speed.", "reflected_inertia, command_delay"),
    "zero_offset": ("Angles zeroed in neutral hide it; the robot leans, and walks change.", "link_length, com_shift"),
}
"""By effect: what it looks like in a recording; what it is easily confused with."""
HEAD = """# Effects

Physics beyond the nominal model, each one file in `workbench/effects/library/`. A `model.yaml` lists them; every verb and any
other Drake project takes that file. [Adding one](extending.md#an-effect) is one file of your own package.

*Typical* is the size from which a small robot feels it; searches begin there.

Made from the code by `python -m docs.effects_page`.
"""


def page() -> str:
    """The whole page."""
    parts = [HEAD]
    effects = {name: e for name, e in known_effects().items() if type(e).__module__.startswith("workbench.")}
    for layer, title in LAYERS.items():
        parts.append(f"## {title}\n")
        parts += [_effect(e) for _, e in sorted(effects.items()) if e.layer == layer]
    return "\n".join(parts)


def _effect(effect: Effect) -> str:
    looks, confused = SEEN[effect.name]
    places = ", ".join(p.replace("_", " ") for p in effect.places)
    lines = [f"### {effect.name}\n", f"**Where**: {places}. **In a recording**: {looks} "
             f"**Easily confused with**: {confused}.\n"]
    said = []
    if effect.under_load:
        said.append("Shows only under load.")
    if not effect.observable_when_fixed:
        said.append("A robot on a stand cannot show it.")
    if effect.equivalent_to:
        said.append(f"No walk tells it from {', '.join(effect.equivalent_to)}.")
    if effect.reduces_to:
        said.append(f"At its limit it is {effect.reduces_to}.")
    if effect.estimator:
        said.append(f"Read off the recordings without a search ({effect.estimator}).")
    if said:
        lines.append(" ".join(said) + "\n")
    if effect.parameters:
        lines += ["| parameter | unit | range | typical |", "|---|---|---|---|", *map(_row, effect.parameters), ""]
    where = () if "robot" in effect.places else ("PLACE",)
    lines.append(f"```yaml\n{_yaml(EffectSpec(effect.name, where, _typical(effect)))}\n```\n")
    return "\n".join(lines)


def _row(p: Parameter) -> str:
    kind = " (three numbers)" if p.vector else ""
    left_out = ", may be left out" if p.option else ""
    unit = p.unit if p.unit not in ("", "1") else "–"
    return f"| `{p.name}`{kind}{left_out} | {unit} | {p.low:g} to {p.high:g} | {p.typical:g} |"


def _typical(effect: Effect) -> dict[str, float | tuple[float, float, float]]:
    return {p.name: (p.typical, 0.0, 0.0) if p.vector else p.typical for p in effect.parameters if not p.option}


def _yaml(spec: EffectSpec) -> str:
    numbers = {k: f"[{', '.join(f'{x:g}' for x in v)}]" if isinstance(v, tuple) else f"{v:g}" for k, v in spec.parameters.items()}
    inside = f", parameters: {{{', '.join(f'{k}: {v}' for k, v in numbers.items())}}}" if numbers else ""
    return f"- {{effect: {spec.effect}, where: [{', '.join(spec.where)}]{inside}}}"


if __name__ == "__main__":
    print(write_whole(PAGE, page()))
