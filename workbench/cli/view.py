"""`workbench view MODEL|TAKE|SESSION`: live Meshcat."""

from __future__ import annotations

import argparse
import time

from workbench.cli.options import PUPPY, add_cycles, add_model, load_model, port, seconds


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Registers the verb."""
    parser = subparsers.add_parser(
        "view",
        help="open a robot, a take or a session in live Meshcat",
        description="Serves Drake's Meshcat and prints the address to open in a browser, until Ctrl-C. A robot (model.yaml, SDF, "
        "URDF, or a name such as puppy) gets a slider for each joint; a motion is simulated and plays; a recording or a "
        "rollout plays; of a session one take plays with the recorded robot as a ghost over the simulated one. "
        "A file that opens without a server is what `simulate` writes: replay.html.")
    parser.add_argument("subject", metavar="MODEL|TAKE|SESSION")
    parser.add_argument("--take", metavar="NAME", help="which take of a session (default: its first)")
    parser.add_argument("--base", choices=("free", "fixed"),
                        help="base of a recording or motion (default: as in the model's takes, else free)")
    add_cycles(parser, 3)
    parser.add_argument("--port", type=port, metavar="N", help="server port (default: the first free one from 7000 on)")
    parser.add_argument("--seconds", type=seconds, metavar="S", help="stop after S seconds")
    add_model(parser, "the bundled puppy")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Shows the subject and waits."""
    from workbench.cli.progress import Progress, show_warnings, warn
    from workbench.view.scene.live import open_meshcat, pose_by_sliders, show, show_session, show_take
    from workbench.view.scene.subject import subject_of, take_of

    subject = subject_of(args.subject)
    of_no_use = {"session": ("base", "cycles"), "model": ("take", "base", "cycles")}.get(subject, ("take",))
    warn("view", [f"--{name} has no effect on a {subject}" for name in of_no_use if getattr(args, name) is not None])
    model = load_model(args.subject if subject == "model" else args.model, args.packages)
    with Progress("view") as progress:
        if subject == "session":
            from workbench.compare.session import load_session

            session = load_session(args.subject)
            session = session if args.model == PUPPY else session.with_model(model)
            meshcat = show_session(session, args.take, open_meshcat(args.port), progress)
        elif subject == "model":
            meshcat = show(model, open_meshcat(args.port))
        else:
            take = take_of(args.subject, model, args.base or model.usual_base, args.cycles, progress)
            meshcat = show_take(model, take, meshcat=open_meshcat(args.port))
    show_warnings()
    print(f"open {meshcat.web_url()} (Ctrl-C ends)", flush=True)
    until = time.monotonic() + (args.seconds or float("inf"))

    def wait() -> bool:
        time.sleep(0.05)
        return time.monotonic() < until

    try:
        if subject == "model":
            pose_by_sliders(meshcat, model, wait)
        while wait():
            pass
    except KeyboardInterrupt:
        print()
    return 0
