"""`workbench simulate MOTION`: a motion on the simulated robot."""

from __future__ import annotations

import argparse

from workbench.cli.check import add_yes, check_model, check_motion
from workbench.cli.options import add_cycles, add_model, add_out, load_model, time_step


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "simulate",
        help="play a motion on the simulated robot",
        description="Plays a motion table (CSV, or FILE.mtn#PAGE) from neutral on the simulated robot and writes rollout.csv "
        "(the take as one table), figures, and replay.html, which opens from disk and shows the run in 3D.",
    )
    parser.add_argument("motion", metavar="MOTION")
    add_model(parser)
    parser.add_argument("--contact", choices=("point", "hydroelastic"), default="point",
                        help="foot-ground contact model (default: point)")
    parser.add_argument("--base", choices=("free", "fixed"), help="free: walking; fixed: held level on a stand (default: as in "
                        "the takes that the model was diagnosed from, else free)")
    parser.add_argument("--drive", choices=("servo", "fast_servo", "ideal"), default="servo",
                        help="full servo law; its fast approximation; joints that follow the motion exactly")
    add_cycles(parser, 1)
    parser.add_argument("--time-step", type=time_step, default=1e-3, metavar="S",
                        help="simulation time step [s] (default: 0.001)")
    add_yes(parser)
    add_out(parser, default="runs/simulate")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Simulates, writes the table, the figures and the replay, and prints how far it went."""
    from workbench.cli.output import output_directory
    from workbench.cli.progress import Progress
    from workbench.compare.went import how_it_went
    from workbench.motion import load_motion
    from workbench.recording.formats.rollout_table import save_rollout
    from workbench.simulation import Simulation, SimulationConfig
    from workbench.simulation.play import play_motion
    from workbench.view.figures import save_figure
    from workbench.view.figures.rollout import rollout_figures
    from workbench.view.scene.replay import write_replay

    model = load_model(args.model, args.packages)
    base = args.base or model.usual_base
    model.check_base(floating=base == "free")
    motion = load_motion(args.motion, model)
    cycles = motion.often(args.cycles, 1)
    check_model("simulate", model)
    check_motion("simulate", motion, cycles, args.yes)
    config = SimulationConfig(time_step=args.time_step, base=base, drive=args.drive, contact=args.contact)
    with output_directory(args.out) as folder, Progress("simulate", stages=("simulating", "writing")) as progress:
        take = play_motion(Simulation(model, config), motion, cycles, progress=lambda done: progress("simulating", done))
        progress("writing")
        title = f"{motion.name}, {args.contact} contact, {args.drive} drive"
        written = [save_rollout(take, folder / "rollout.csv")]
        written += [write_replay(folder / "replay.html", model, take, title=title).path]
        written += [save_figure(figure, folder / f"{name}.png") for name, figure in rollout_figures(take, model).items()]
    print(how_it_went(take))
    print(f"wrote {args.out}: {', '.join(path.name for path in written)}")
    return 0
