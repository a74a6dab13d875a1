"""MkDocs hook that generates the page effects.md from the effects.

Names, units, ranges, relations and the first paragraph come from the code, the meaning of parameters from docs/formats.md. The
formula, the signature in a recording, and the effects it is easily confused with are given here, once for each.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from workbench.effects.base import Effect, Parameter
from workbench.effects.registry import known_effects
from workbench.robot import EffectSpec

PAGE = "effects.md"
LAYERS = {
    "timing": "Timing: which commands reach the servos, and when", "actuator": "Actuators: how a servo follows its goal",
    "structure": "Structure: what lies between servo and link", "inertia": "Inertia: masses",
    "ground": "Ground: floor and external forces", "measurement": "Measurement: how the robot is observed"}


class Seen(NamedTuple):
    """Of one effect: the formula (symbols: head of the page), the signature in a recording, and the effects with which it is
    easily confused."""

    formula: str
    looks: str
    confused: str


SEEN: dict[str, Seen] = {
    "backlash": Seen(
        "`|q_link − q| ≤ gap/2`; inside it the link turns freely, with a damping of 0.5 mN m s/rad",
        "The link lags by the gap wherever the load changes sign: steps of constant size at turning points. Under gravity alone "
        "the link stays at one end of the gap, and little is visible.",
        "dead_band, coulomb_friction, joint_compliance"),
    "clock_rate": Seen(
        "`t_recording = t_first + ratio · t`",
        "The delay of all joints grows in proportion to time.",
        "timing_drift, if all dwells are equal"),
    "com_shift": Seen(
        "`c = c₀ + offset`, the inertia about the centre of mass unchanged",
        "The robot leans, and walks turn; joints that carry the link have errors that depend on gravity.",
        "payload, com_shift of a neighbouring link"),
    "command_delay": Seen(
        "a command sent at `t` acts at `t + delay`",
        "The whole curve is delayed by a constant; joints at rest are not affected.",
        "reflected_inertia, a late start"),
    "coulomb_friction": Seen(
        "`τ = −sign(ω) (τ_C + torque)`; at rest it holds up to `τ_C + torque`",
        "The joint sticks at slow reversals and stops short of its goal from either side.",
        "dead_band, load_friction"),
    "command_filter": Seen(
        "`T df/dt = goal − f`, `T = T₀ + time`; ref moves to f",
        "Steps are rounded, and everything is later by the time constant; joints at rest are not affected.",
        "command_delay, goal_ramp"),
    "damping_gain": Seen(
        "`duty = duty(e) − (k₀ + gain) ω`, cut at ±1",
        "The joint is slower while torque is on and duty below its maximum; at full duty its speed is unchanged.",
        "viscous_friction, which also acts with torque off"),
    "dead_band": Seen(
        "`d = |e| − (margin₀ + margin)`",
        "The joint stops short of its goal by a constant angle, with little motor torque.",
        "backlash, coulomb_friction"),
    "dropped_command": Seen(
        "`P(pose k is missed) = probability`, each independently; goal and speed of pose k−1 then remain",
        "Single poses are missing: the joint continues as before until the next one.",
        "joint_stop, coulomb_friction"),
    "foot_friction": Seen(
        "`|F_t| ≤ friction · F_n` at this foot",
        "One foot slips, and the robot turns towards or away from it. Not visible on a stand.",
        "foot_friction of another foot, payload"),
    "friction_asymmetry": Seen(
        "`τ = −sign(ω) τ_C (1 + s sign(ω))`, `s = (ratio − 1)/(ratio + 1)`",
        "Motion in one direction lags more than in the other; at rest the error depends on the direction of approach.",
        "coulomb_friction, parallel_spring"),
    "goal_ramp": Seen(
        "`|d ref/dt| ≤ speed`",
        "Large steps are late in proportion to their size; small and slow ones are not affected.",
        "command_delay, a weak supply, command_filter"),
    "ground_friction": Seen(
        "`|F_t| ≤ friction · F_n` at each foot",
        "The robot walks less far, or turns, while its joints follow the model.",
        "ground_tilt, tether_force"),
    "ground_tilt": Seen(
        "`g = 9.81 m/s² · n/|n|`, `n = (tan forward, tan left, −1)`",
        "The robot drifts and turns to one side; it leans from the start.",
        "tether_force"),
    "joint_compliance": Seen(
        "`τ = stiffness (Δq + 1 ms · dΔq/dt)`, `Δq = q − q_link`",
        "The link sags under load and oscillates after steps, while the servo's own sensor shows no error.",
        "servo_gain, which causes the same sag"),
    "joint_stop": Seen(
        "`lower ≤ q ≤ upper`, or the limit in the robot's description if it is nearer",
        "The curve is clipped at an angle.",
        "dropped_command, if it is reached only once"),
    "link_length": Seen(
        "`p = p₀ (1 + change/|p₀|)`, p from the link's joint to the next, or to its foot",
        "The distance of two joint axes seen by cameras differs from the model; walks go farther, or turn.",
        "zero_offset of a neighbouring joint, com_shift"),
    "load_friction": Seen(
        "`τ = −sign(ω) (τ_C + |τ_load| (coefficient + static · exp(−(ω/speed)²) + backdrive))`, the last term only where "
        "motor torque and ω have opposite signs",
        "The error before reversals increases with the load on the joint.",
        "coulomb_friction, if the load is always the same"),
    "loose_mount": Seen(
        "the link turns freely by φ about `axis`, `|φ| ≤ play/2`",
        "The link turns about an axis that no servo turns.",
        "marker_frame, if the link does not move in its play"),
    "marker_frame": Seen(
        "`R_seen = R exp([rotation]×)`",
        "The rotations of a rigid body are about rotated axes; nothing else changes.",
        "loose_mount, zero_offset"),
    "parallel_spring": Seen(
        "`τ = −stiffness · q`",
        "The error increases with the angle, independently of the load (a taut cable).",
        "servo_gain, payload"),
    "minimum_duty": Seen(
        "`duty = sign(e) (p₀ + duty + gain · d)` outside the dead zone",
        "The joint gets closer to its goal before it stops, and may oscillate there.",
        "servo_gain, coulomb_friction below nominal"),
    "payload": Seen(
        "`m = m₀ + mass`, `c = (m₀ c₀ + mass · position)/m`, inertia including that of the point mass",
        "Joints that carry it have errors that depend on gravity and acceleration; walks change.",
        "com_shift with the same moment"),
    "reflected_inertia": Seen(
        "`I = I₀ + inertia`",
        "Fast motions lag and overshoot; slow ones match the model.",
        "command_delay, viscous_friction"),
    "servo_gain": Seen(
        "`duty = sign(e) min(1, punch + ratio (1 − punch) d/slope)`, or `clip(ratio · gain · e, −1, 1)`",
        "Errors under load change by a constant ratio.",
        "joint_compliance, supply_voltage (if there is only one joint)"),
    "soft_ground": Seen(
        "`F_n = k · depth` at each contact point, `1/k = 1/stiffness + 1/k_ground`",
        "Feet sink in; steps are shorter and softer.",
        "ground_tilt, com_shift"),
    "speed_order": Seen(
        "`speed(k-th bus ID) = speed₀(k-th joint by name)`",
        "Every joint runs at another joint's speed: the ends of the ramps are right, their slopes wrong.",
        "no other effect"),
    "stribeck_friction": Seen(
        "`τ = −sign(ω) (τ_C + torque · exp(−(ω/speed)²))`",
        "The joint jumps when it breaks loose; fast motion matches the model.",
        "coulomb_friction"),
    "supply_sag": Seen(
        "`V = max(V₀ − drop · Σ|duty|, 0)`, summed over all servos; acts on the duty torque",
        "All joints are weaker while many of them need high duty at once.",
        "supply_voltage, if the load is constant"),
    "supply_voltage": Seen(
        "`τ_duty = duty · τ_stall · voltage/V_rated`",
        "All joints are weaker, and slower at full duty.",
        "thermal_fade in short takes, torque_ceiling"),
    "tether_force": Seen(
        "`F_W = force`, at the base link's origin",
        "The robot is pulled in one direction, at rest as much as in motion.",
        "ground_tilt"),
    "thermal_fade": Seen(
        "`τ_duty · exp(−rate · t)`",
        "All joints slowly get weaker during a take.",
        "supply_voltage in short takes"),
    "timing_drift": Seen(
        "pose k is sent at `t_k + k · per_pose`, k from 0",
        "The delay of all joints grows by a step at each pose.",
        "clock_rate, if all dwells are equal"),
    "torque_ceiling": Seen(
        "`τ_motor = clip(τ_duty − τ_emf, −torque, torque)`",
        "One joint stalls or lags at its torque peaks; elsewhere it matches the model.",
        "supply_voltage, torque_saturation"),
    "torque_saturation": Seen(
        "`τ_motor = x/(1 + |x|/torque)`, `x = τ_duty − τ_emf`",
        "The lag of one joint increases with the torque that it needs.",
        "torque_ceiling, servo_gain"),
    "viscous_friction": Seen(
        "`τ = −(b₀ + coefficient) ω`",
        "The joint lags in proportion to its speed.",
        "reflected_inertia, command_delay"),
    "zero_offset": Seen(
        "`q_link = q + angle`",
        "Not visible in angles zeroed in neutral; the robot leans, and walks change.",
        "link_length, com_shift"),
}
LIMITS = {
    "payload": "Close to com_shift if `mass` is small compared with the link's mass: `offset = mass (position − c₀)/m`.",
    "stribeck_friction": "Reduces to coulomb_friction as `speed` goes to infinity.",
}
"""How an effect reduces to the simpler one, its `reduces_to`."""
HEAD = """# Effects

An effect is a piece of physics beyond the nominal model, in one file in `workbench/effects/library/`. A `model.yaml` lists the
effects of a robot; pass it with `--model` to any command that simulates, exports to or moves the robot. In another Drake project,
load it with `workbench.MakeStation(workbench.load_model("model.yaml"))`. To [add an effect](extending.md#an-effect), write one
file in your own package.

*Typical* is the size from which an effect is noticeable on a small robot; searches start there. A range from *−nominal* on is
that of an effect that is added to a constant of the servo, and can also take it away ([formats](formats.md#7-effects)).

Symbols: q, ω: angle and speed of the servo's joint; q_link: angle of its link; τ: torque; e, d, duty, slope, punch: defined by
[the servo law](formats.md#4-nominal-servo-law-servoyaml), as are the duty torque τ_duty, the back-EMF torque τ_emf, and the
nominal Coulomb and viscous friction τ_C and b₀; t: time since the first command; m, c: mass and centre of mass of a link;
F_t, F_n: tangential and normal contact force. Index 0: nominal.

Generated from the code and from [the formats page](formats.md#7-effects).
"""
FORMATS = Path(__file__).with_name("formats.md")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Adds the page to the site."""
    files.append(File.generated(config, PAGE, content=page()))
    return files


def page() -> str:
    """The whole page."""
    parts, known = [HEAD], meanings()
    effects = {name: e for name, e in known_effects().items() if type(e).__module__.startswith("workbench.")}
    for layer, title in LAYERS.items():
        parts.append(f"## {title}\n")
        parts += [_effect(e, known[e.name]) for _, e in sorted(effects.items()) if e.layer == layer]
    return "\n".join(parts)


def meanings() -> dict[str, str]:
    """The meaning of the parameters by effect: the third column of the table in section 7 of docs/formats.md."""
    section = FORMATS.read_text(encoding="utf-8").split("\n## 7. Effects\n", 1)[1]
    out = {}
    for line in section.splitlines():
        cells = [c.strip().replace("\\|", "|") for c in re.split(r"(?<!\\)\|", line)[1:-1]]
        for name in re.findall(r"`(\w+)`", cells[0]) if len(cells) == 3 else ():
            out[name] = _of_one(known_effects()[name], cells[2])
    return out


def _of_one(effect: Effect, meaning: str) -> str:
    """The part of a row for several effects that belongs to one; the other effects' parameters and units are omitted."""
    own = {p.name for p in effect.parameters}
    parts = []
    for part in re.split(r", (?=`)", meaning):
        begins = re.match(r"`(\w+)`", part)
        is_others = begins is not None and begins[1] not in own
        parts.append(part.partition(", ")[2] if is_others else part)
    return ", ".join(filter(None, parts))


def _effect(effect: Effect, meaning: str) -> str:
    places = ", ".join(p.replace("_", " ") for p in effect.places)
    seen = SEEN[effect.name]
    lines = [f"### {effect.name}\n", f"{_first_paragraph(effect)} **Acts on**: {places}.\n", f"**Formula**: {seen.formula}\n",
             f"**In a recording**: {seen.looks} **Easily confused with**: {seen.confused}.\n"]
    said = []
    if effect.under_load:
        said.append("Observable only under load.")
    if not effect.observable_when_fixed:
        said.append("Not observable on a robot whose base is held.")
    if effect.equivalent_to:
        said.append(f"A walk cannot separate it from {', '.join(effect.equivalent_to)}.")
    if effect.reduces_to:
        said.append(LIMITS[effect.name])
    if effect.estimator:
        said.append(f"Estimated directly from the recordings, without a search ({effect.estimator}).")
    if said:
        lines.append(" ".join(said) + "\n")
    if effect.parameters:
        lines += [f"**Parameters**: {meaning}.\n", "| parameter | unit | range | typical |", "|---|---|---|---|",
                  *map(_row, effect.parameters), ""]
    where = () if "robot" in effect.places else ("PLACE",)
    lines.append(f"```yaml\n{_yaml(EffectSpec(effect.name, where, _typical(effect)))}\n```\n")
    return "\n".join(lines)


def _first_paragraph(effect: Effect) -> str:
    """The first paragraph of the effect's class docstring."""
    said = " ".join((type(effect).__doc__ or "").split("\n\n")[0].split())
    return said if said.endswith(".") else f"{said}."


def _row(p: Parameter) -> str:
    kind = " (three numbers)" if p.vector else ""
    optional = ", optional" if p.option else ""
    unit = p.unit if p.unit not in ("", "1") else "–"
    low = "−nominal" if p.adds_to else f"{p.low:g}"  # the servo's own constant
    return f"| `{p.name}`{kind}{optional} | {unit} | {low} to {p.high:g} | {p.typical:g} |"


def _typical(effect: Effect) -> dict[str, float | tuple[float, float, float]]:
    return {p.name: (p.typical, 0.0, 0.0) if p.vector else p.typical for p in effect.parameters if not p.option}


def _yaml(spec: EffectSpec) -> str:
    numbers = {k: f"[{', '.join(f'{x:g}' for x in v)}]" if isinstance(v, tuple) else f"{v:g}" for k, v in spec.parameters.items()}
    inside = f", parameters: {{{', '.join(f'{k}: {v}' for k, v in numbers.items())}}}" if numbers else ""
    return f"- {{effect: {spec.effect}, where: [{', '.join(spec.where)}]{inside}}}"
