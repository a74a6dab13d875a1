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
    """One effect: its formula (symbols in the page's head), its signature in a recording, and the effects with which it is easily
    confused."""

    formula: str
    looks: str
    confused: str


SEEN: dict[str, Seen] = {
    "backlash": Seen(
        "`|q_link − q| ≤ gap/2`; inside it the link turns freely, but for a damping of 0.5 mN m s/rad",
        "The link stays behind by the gap wherever the load changes sign; steps of constant size at turning points. Under "
        "gravity alone it hangs at one side and shows little.",
        "dead_band, coulomb_friction, joint_compliance"),
    "clock_rate": Seen(
        "`t_recording = t_first + ratio · t`",
        "All joints run later and later, in proportion to time.",
        "timing_drift, where all dwells are equal"),
    "com_shift": Seen(
        "`c = c₀ + offset`, the inertia about the centre of mass as it was",
        "The robot leans, and walks turn; joints that carry the link err with gravity.",
        "payload, com_shift of a neighbour"),
    "command_delay": Seen(
        "a command that is due at `t` acts at `t + delay`",
        "The whole curve comes later by a constant; joints at rest show nothing.",
        "reflected_inertia, a late start"),
    "coulomb_friction": Seen(
        "`τ = −sign(ω) (τ_C + torque)`; at rest it holds up to `τ_C + torque`",
        "Slow reversals stick; the joint stops short of its goal from either side.",
        "dead_band, load_friction"),
    "command_filter": Seen(
        "`T df/dt = goal − f`, `T = T₀ + time`; ref moves to f",
        "Steps come rounded, and everything later by the time constant; joints at rest show nothing.",
        "command_delay, goal_ramp"),
    "damping_gain": Seen(
        "`duty = duty(e) − (k₀ + gain) ω`, cut at ±1",
        "The joint is slower where duty is not full, with torque on alone; at full duty it is as fast as ever.",
        "viscous_friction, which also acts with torque off"),
    "dead_band": Seen(
        "`d = |e| − (margin₀ + margin)`",
        "The joint stops short of its goal by a constant angle, with little torque.",
        "backlash, coulomb_friction"),
    "dropped_command": Seen(
        "`P(pose k is missed) = probability`, each independently; then goal and speed of pose k−1 stay",
        "Single poses are missing: the joint continues as before until the next one.",
        "joint_stop, coulomb_friction"),
    "foot_friction": Seen(
        "`|F_t| ≤ friction · F_n` at this foot",
        "One foot slips; the robot turns towards or away from it. A robot on a stand shows nothing.",
        "foot_friction of a neighbour, payload"),
    "friction_asymmetry": Seen(
        "`τ = −sign(ω) τ_C (1 + s sign(ω))`, `s = (ratio − 1)/(ratio + 1)`",
        "One direction of travel lags more than the other; at rest the error depends on where it came from.",
        "coulomb_friction, parallel_spring"),
    "goal_ramp": Seen(
        "`|d ref/dt| ≤ speed`",
        "Large steps come late in proportion to their size; small and slow ones show nothing.",
        "command_delay, a weak supply, command_filter"),
    "ground_friction": Seen(
        "`|F_t| ≤ friction · F_n` at each foot",
        "The robot goes less far, or turns; joints are as they should be.",
        "ground_tilt, tether_force"),
    "ground_tilt": Seen(
        "`g = 9.81 m/s² · n/|n|`, `n = (tan forward, tan left, −1)`",
        "The robot drifts and turns to one side; it leans from the start.",
        "tether_force"),
    "joint_compliance": Seen(
        "`τ = stiffness (Δq + 1 ms · dΔq/dt)`, `Δq = q − q_link`",
        "The link sags with load and swings after steps, where the servo's own sensor is right.",
        "servo_gain, which sags the same way"),
    "joint_stop": Seen(
        "`lower ≤ q ≤ upper`, or the description's own end where that is nearer",
        "The curve is cut off flat at an angle.",
        "dropped_command, where it is met once"),
    "link_length": Seen(
        "`p = p₀ (1 + change/|p₀|)`, p from the link's joint to the next, or to its foot",
        "Cameras see two axes at another distance; walks go farther or turn.",
        "zero_offset of a neighbour, com_shift"),
    "load_friction": Seen(
        "`τ = −sign(ω) (τ_C + |τ_load| (coefficient + static · exp(−(ω/speed)²) + backdrive))`, the last term only where "
        "motor torque and ω are opposed",
        "The error before reversals grows with the load that the joint carries.",
        "coulomb_friction, under one load"),
    "loose_mount": Seen(
        "the link turns freely by φ about `axis`, `|φ| ≤ play/2`",
        "The link turns about an axis that no servo turns.",
        "marker_frame, when it lies still"),
    "marker_frame": Seen(
        "`R_seen = R exp([rotation]×)`",
        "A rigid body's rotations come about turned axes; nothing else changes.",
        "loose_mount, zero_offset"),
    "parallel_spring": Seen(
        "`τ = −stiffness · q`",
        "The error grows with the angle, load or not (a taut cable).",
        "servo_gain, payload"),
    "minimum_duty": Seen(
        "`duty = sign(e) (p₀ + duty + gain · d)` outside the dead zone",
        "The joint comes closer to its goal before it stops, and may hum there.",
        "servo_gain, less coulomb_friction"),
    "payload": Seen(
        "`m = m₀ + mass`, `c = (m₀ c₀ + mass · position)/m`, the inertia with that of the point",
        "Joints above it err with gravity and acceleration; walks change.",
        "com_shift, which has the same moment"),
    "reflected_inertia": Seen(
        "`I = I₀ + inertia`",
        "Fast motions lag and overshoot; slow ones are right.",
        "command_delay, viscous_friction"),
    "servo_gain": Seen(
        "`duty = sign(e) min(1, punch + ratio (1 − punch) d/slope)`, or `clip(ratio · gain · e, −1, 1)`",
        "Errors under load grow or shrink by a ratio.",
        "joint_compliance, supply_voltage at one joint"),
    "soft_ground": Seen(
        "`F_n = k · depth` at each contact point, `1/k = 1/stiffness + 1/k_ground`",
        "Feet sink in; steps are shorter and softer.",
        "ground_tilt, com_shift"),
    "speed_order": Seen(
        "`speed(k-th bus ID) = speed₀(k-th joint by name)`",
        "Every joint runs at another joint's speed: right ends, wrong ramps.",
        "nothing else does this"),
    "stribeck_friction": Seen(
        "`τ = −sign(ω) (τ_C + torque · exp(−(ω/speed)²))`",
        "A jump when the joint breaks loose; fast motion is right.",
        "coulomb_friction"),
    "supply_sag": Seen(
        "`V = max(V₀ − drop · Σ|duty|, 0)`, the sum over all servos; acts on the duty torque",
        "All joints weaken while many work hard at once.",
        "supply_voltage, under steady work"),
    "supply_voltage": Seen(
        "`τ_duty = duty · τ_stall · voltage/V_rated`",
        "All joints are weaker, and slower at full duty.",
        "thermal_fade in short takes, torque_ceiling"),
    "tether_force": Seen(
        "`F_W = force`, at the base link's origin",
        "The robot is pulled one way, as much at rest as in motion.",
        "ground_tilt"),
    "thermal_fade": Seen(
        "`τ_duty · exp(−rate · t)`",
        "All joints weaken slowly through a take.",
        "supply_voltage in short takes"),
    "timing_drift": Seen(
        "pose k is sent at `t_k + k · per_pose`, k from 0",
        "All joints run later by a step at each pose.",
        "clock_rate, where all dwells are equal"),
    "torque_ceiling": Seen(
        "`τ_motor = clip(τ_duty − τ_emf, −torque, torque)`",
        "One joint stalls or lags at its peaks of torque; elsewhere it is right.",
        "supply_voltage, torque_saturation"),
    "torque_saturation": Seen(
        "`τ_motor = x/(1 + |x|/torque)`, `x = τ_duty − τ_emf`",
        "One joint lags the more, the more torque it needs.",
        "torque_ceiling, servo_gain"),
    "viscous_friction": Seen(
        "`τ = −(b₀ + coefficient) ω`",
        "The joint lags in proportion to its speed.",
        "reflected_inertia, command_delay"),
    "zero_offset": Seen(
        "`q_link = q + angle`",
        "Angles zeroed in neutral hide it; the robot leans, and walks change.",
        "link_length, com_shift"),
}
LIMITS = {
    "payload": "Close to com_shift where `mass` is small compared with the link's: `offset = mass (position − c₀)/m`.",
    "stribeck_friction": "Reduces to coulomb_friction as `speed` goes to infinity.",
}
"""How an effect becomes the simpler one that it `reduces_to`."""
HEAD = """# Effects

Physics beyond the nominal model, each one file in `workbench/effects/library/`. A `model.yaml` lists them; the verbs that
simulate, export or move the robot take it as `--model`. Another Drake project loads it with
`workbench.MakeStation(workbench.load_model("model.yaml"))`. [Adding one](extending.md#an-effect) is one file of your own package.

*Typical* is the size from which an effect is noticeable on a small robot; searches start there. Symbols: q, ω: angle and speed
of the servo's joint, q_link: angle of its link; τ: torque; e, d, duty, slope, punch: of
[the servo law](formats.md#4-nominal-servo-law-servoyaml), which gives the duty torque τ_duty, the back-EMF torque τ_emf and the
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
    """By effect, what its parameters mean: the third column of the table in section 7 of docs/formats.md."""
    section = FORMATS.read_text(encoding="utf-8").split("\n## 7. Effects\n", 1)[1]
    out = {}
    for line in section.splitlines():
        cells = [c.strip().replace("\\|", "|") for c in re.split(r"(?<!\\)\|", line)[1:-1]]
        for name in re.findall(r"`(\w+)`", cells[0]) if len(cells) == 3 else ():
            out[name] = _of_one(known_effects()[name], cells[2])
    return out


def _of_one(effect: Effect, meaning: str) -> str:
    """Of a row for several effects the part of one: parameters of others, and their units, are left out."""
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
    return f"| `{p.name}`{kind}{optional} | {unit} | {p.low:g} to {p.high:g} | {p.typical:g} |"


def _typical(effect: Effect) -> dict[str, float | tuple[float, float, float]]:
    return {p.name: (p.typical, 0.0, 0.0) if p.vector else p.typical for p in effect.parameters if not p.option}


def _yaml(spec: EffectSpec) -> str:
    numbers = {k: f"[{', '.join(f'{x:g}' for x in v)}]" if isinstance(v, tuple) else f"{v:g}" for k, v in spec.parameters.items()}
    inside = f", parameters: {{{', '.join(f'{k}: {v}' for k, v in numbers.items())}}}" if numbers else ""
    return f"- {{effect: {spec.effect}, where: [{', '.join(spec.where)}]{inside}}}"
