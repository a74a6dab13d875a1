"""The table of the filters' study, beside what the thesis says."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from studies import inputs
from studies.filters.measure import CYCLE, WINDOWS, Result
from studies.inputs import JOINT, STEP


def report(results: list[Result], alone: Mapping[str, float]) -> str:
    """The table, and what was found beside what the thesis says."""
    measured_by = " and ".join(r.reference[0] for r in results)
    lines = [
        "# Input filters", "", "The ROBOTIS walk, looped, and a synthetic capture of it at 120 Hz, whose true velocity is known.",
        " ".join((inputs.__doc__ or "").split("\n\n")[1].split()), "",
        "| input | filter | velocity error deg/s | lag ms | v not the derivative of q, deg | x cm | left cm | heading deg |",
        "|---|---|---|---|---|---|---|---|",
        *(f"| {result.title} | {r.filter} | {r.velocity_error:.1f} | {r.lag:.1f} | {r.stray:.2f} | {r.x:.1f} | {r.left:.1f} "
          f"| {r.heading:.1f} |" for result in results for r in result.rows), "",
        f"Velocity error and lag are {JOINT}'s, against {measured_by}. The body's end is simulated with the angles themselves "
        "filtered, as Drake's joints cannot have a velocity that contradicts their angle.", "",
        "| the thesis | here |", "|---|---|",
        *(f"| {says} | {here} |" for says, here in findings(results[0], results[1], alone)), "",
    ]
    return "\n".join(lines)


def findings(walk: Result, seen: Result, alone: Mapping[str, float]) -> Iterator[tuple[str, str]]:
    """What the thesis says, and what is seen here: of the walk's own angles, and of their capture."""
    errors = ", ".join(f"{seen.row(f'window {w}').velocity_error:.0f}" for w in WINDOWS)
    yield ('7.2.2: "Even a window size of 91 still results in noisy peaks. Much larger window sizes (e.g. 1001, 2001) manage to '
           'smooth out the peaks significantly."',
           f"91 samples are 9.1 ms, one frame (8.3 ms). Velocity error of the capture at 91, 1001 and 2001: {errors} deg/s, of "
           f"{seen.row('unfiltered').velocity_error:.0f} unfiltered. 2001 samples, {2000 * STEP / CYCLE:.0%} of a gait cycle, "
           "take part of the motion away.")
    yield ('6.7: "Due to the large number of data points and the small step size, the derivatives are extremely noisy"',
           "cubicpolytraj rests at every sample unless it is given velocities (whether it was is not said). That alone makes "
           f"{alone['rest']:.0f} deg/s of error without any noise; the noise alone, on a spline that does not rest, "
           f"{alone['noise']:.0f}.")
    yield ('7.2.2: "This amount of smoothing is comparable with the automatic MATLAB filtering"; 6.8: "a slight time offset"',
           f"Comparable to 1001 and 2001 are time constants of {seen.like[1001] * 1e3:.0f} and {seen.like[2001] * 1e3:.0f} ms; "
           "they lag by twice that.")
    ends = "; ".join(f"{r.title}: x {r.spread(0)[0]:.1f} and {r.spread(0)[1]:.1f} cm, heading {r.spread(2)[0]:.0f} and "
                     f"{r.spread(2)[1]:.0f} deg" for r in (walk, seen))
    yield ('7.2.2: "for window sizes 1001 and 2001 the filtered velocities are similar, the resulting position and rotation '
           'trajectories are not"',
           f"Spread of the end over the three windows, and of the unfiltered run over steps and contact solvers: {ends}. "
           f"Velocity filtered for itself strays from the angle by {seen.row('window 1001').stray:.1f} and "
           f"{seen.row('window 2001').stray:.1f} deg at 1001 and 2001.")
    yield ("7.2.2: ROBOTIS angles end at 32.70 cm (MATLAB filter) and 32.35 cm (own filter)",
           f"{walk.row('low-pass').x:.1f} and {walk.row('window 1001').x:.1f} cm")
