"""A 3D replay as a moving picture for the README: python -m docs.moving_picture REPLAY.html OUT.gif [--frames 30] [--seconds 2]

Chromium plays the page without a window; its time bar is set to each frame's time over the DevTools protocol. Needs Chromium, and
tornado and Pillow, which the development environment has.
"""

from __future__ import annotations

import argparse
import asyncio
import base64
import io
import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.request import urlopen

from PIL import Image
from tornado.websocket import WebSocketClientConnection, websocket_connect

FLAGS = ("--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
         "--hide-scrollbars", "--no-first-run", "--disable-background-networking", "--remote-debugging-port=0")
BARE = """document.querySelectorAll("body > *").forEach(e => { if (!e.querySelector("canvas")) e.style.visibility = "hidden"; });
  document.querySelectorAll(".dg").forEach(e => e.remove());"""
"""Nothing but the scene."""
LOOK = "viewer.camera.position.set(%f, %f, %f); viewer.controls.target.set(%f, %f, %f); viewer.controls.update();"
SEEK = """(() => { const bar = document.getElementById("wb-time"); bar.value = %f;
  bar.dispatchEvent(new Event("input")); })()"""
READY = 'typeof viewer !== "undefined" && viewer.animator.duration > 0 && document.getElementById("wb-time") !== null'


class Page:
    """One page of a running Chromium, spoken to over its DevTools protocol."""

    def __init__(self, connection: WebSocketClientConnection) -> None:
        self.connection, self.asked = connection, 0

    async def ask(self, method: str, **parameters: Any) -> Any:
        """The result of a command."""
        self.asked += 1
        await self.connection.write_message(json.dumps({"id": self.asked, "method": method, "params": parameters}))
        while True:
            said = await self.connection.read_message()
            if said is None:
                raise RuntimeError("Chromium ended")
            answer = json.loads(said)
            if answer.get("id") == self.asked:
                return answer.get("result", {})

    async def value(self, expression: str) -> Any:
        """The value of a JavaScript expression."""
        answer = await self.ask("Runtime.evaluate", expression=expression, returnByValue=True)
        return answer["result"].get("value")


async def pictures(replay: Path, times: Sequence[float], size: tuple[int, int], eye: Sequence[float], at: Sequence[float]
                   ) -> list[Image.Image]:
    """The scene at each time [s] of its time bar, `size` pixels wide and high, seen from `eye` towards `at` (3,) [m] in W."""
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        raise RuntimeError("needs Chromium (apt install chromium)")
    with tempfile.TemporaryDirectory() as profile:
        of_its_own = f"--user-data-dir={profile}", f"--window-size={size[0]},{size[1]}"
        running = subprocess.Popen([chromium, *FLAGS, *of_its_own, "about:blank"], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        try:
            page = Page(await websocket_connect(_address(Path(profile)), max_message_size=1 << 28))
            await page.ask("Page.navigate", url=replay.resolve().as_uri())
            while not await page.value(READY):
                await asyncio.sleep(0.5)
            await page.value(BARE)
            await page.value(LOOK % (eye[0], eye[2], -eye[1], at[0], at[2], -at[1]))  # meshcat draws with y up
            out = []
            for t in times:
                await page.value(SEEK % t)
                await asyncio.sleep(0.4)
                shot = await page.ask("Page.captureScreenshot", format="png")
                out.append(Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB"))
            return out
        finally:
            running.terminate()
            running.wait()


def _address(profile: Path, patience: float = 30.0) -> str:
    """Where the only page of a Chromium listens that writes its port into its profile."""
    port, until = profile / "DevToolsActivePort", time.monotonic() + patience
    while not port.exists() or not port.read_text().strip():
        if time.monotonic() > until:
            raise RuntimeError("Chromium does not start")
        time.sleep(0.2)
    with urlopen(f"http://127.0.0.1:{port.read_text().split()[0]}/json/list") as answer:
        pages = [p for p in json.load(answer) if p["type"] == "page"]
    return str(pages[0]["webSocketDebuggerUrl"])


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("replay", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--frames", type=int, default=30)
    parser.add_argument("--begin", type=float, default=0.0, help="time of the first frame [s]")
    parser.add_argument("--seconds", type=float, default=2.0, help="of the robot's time")
    parser.add_argument("--eye", type=float, nargs=3, default=(1.1, -1.3, 0.6), help="in the world [m]")
    parser.add_argument("--at", type=float, nargs=3, default=(0.3, 0.0, 0.08), help="likewise")
    parser.add_argument("--size", type=int, nargs=2, default=(960, 560), help="of the window [px]")
    parser.add_argument("--width", type=int, default=720, help="of the picture [px]")
    args = parser.parse_args()
    times = [args.begin + args.seconds * k / args.frames for k in range(args.frames)]
    shots = asyncio.run(pictures(args.replay, times, tuple(args.size), args.eye, args.at))
    small = [s.resize((args.width, s.height * args.width // s.width), Image.Resampling.LANCZOS) for s in shots]
    palette = small[0].quantize(128)
    frames = [s.quantize(128, palette=palette, dither=Image.Dither.NONE) for s in small]
    frames[0].save(args.out, save_all=True, append_images=frames[1:], duration=round(1000 * args.seconds / args.frames), loop=0,
                   optimize=True)
    print(f"wrote {args.out}: {len(frames)} frames, {args.out.stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
