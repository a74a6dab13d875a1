import base64
import gzip
import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from tests.view_takes import capture, small_robot, swing
from workbench.files import InputError
from workbench.view.figures import film_strip
from workbench.view.report.curves import Curves
from workbench.view.report.page import Details, Picture, Provenance, Replay, Report, Section, Table, Text
from workbench.view.scene.replay import write_replay

VOID = {"meta", "img", "br", "input", "link"}


class Outline(HTMLParser):
    """Text by tag, and whether every element is closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text: dict[str, list[str]] = {}
        self.attributes: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open:
            self.text.setdefault(self.open[-1], []).append(data)


def outline(html: str) -> Outline:
    page = Outline()
    page.feed(html)
    page.close()
    assert not page.open
    return page


def full_report(tmp_path: Path) -> Report:
    model = small_robot(tmp_path)
    take, seen = swing(model), capture(swing(model, delay=0.05))
    replay = write_replay(tmp_path / "replay.html", model, take, seen)
    figure = Figure()
    figure.subplots().plot([0, 1])
    return Report(
        "Walk <1>", "It walks `x` & turns.", summary="First.\n\nSecond **bold**.",
        key_numbers=[("distance", "24 cm", "floor 1 cm")],
        provenance=Provenance.of(model, seed=7, seconds=1.25, config="point contact"),
    ).add(Section("Seen", [Replay(replay.path, "ghost", film_strip(model, take, seen))])).add(Section("Numbers & names", [
        Text("A paragraph."),
        Table(["joint", "error [deg]", "note"], [["flm", "1.20", "a"], ["frm", "−0.3", "b"]], "All.", emphasis=[0]),
        Picture(figure, "A line."), Details("More", [Text("Hidden.")]),
    ]))


def test_the_page_is_well_formed_and_says_everything(tmp_path: Path) -> None:
    html = full_report(tmp_path).html()
    page = outline(html)
    assert "".join(page.text["h1"]) == "It walks  & turns."
    assert page.text["code"] == ["x"]
    assert page.text["h2"] == ["Seen", "Numbers & names"]
    assert page.text["title"] == ["Walk <1>"]
    assert [t for t in page.text["td"] if t.strip()] == ["flm", "1.20", "a", "frm", "−0.3", "b"]
    right = [a for tag, a in page.attributes if tag == "td" and a.get("class") == "n"]
    assert len(right) == 2  # the column of numbers
    footer = html[html.index("<footer>"):]
    for said in ("workbench", "drake", "seed</b> 7", "1.2 s", "config</b> point contact", "model"):
        assert said in footer


def test_the_page_asks_nothing_from_the_network(tmp_path: Path) -> None:
    html = full_report(tmp_path).html()
    for tag, attributes in outline(html).attributes:
        for key in ("src", "href"):
            assert (attributes.get(key) or "data:").startswith("data:"), tag
    assert not re.search(r"@import|url\(", html)


def test_the_replay_inside_is_the_file(tmp_path: Path) -> None:
    html = full_report(tmp_path).html()
    (packed,) = re.findall(r'<script type="application/gzip">([^<]+)</script>', html)
    assert gzip.decompress(base64.b64decode(packed)) == (tmp_path / "replay.html").read_bytes()
    assert len(html) < 1_800_000


def test_same_report_same_bytes(tmp_path: Path) -> None:
    assert full_report(tmp_path).html() == full_report(tmp_path).html()


def test_a_report_without_replay_has_no_script() -> None:
    html = Report("T", "H").add(Section("S", [Text("x")])).html()
    assert "<script" not in html


def test_nothing_is_left_where_it_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        Report("T", "H").write(tmp_path / "file" / "report.html")
    with pytest.raises(InputError, match="cannot be read"):
        Report("T", "H").add(Section("S", [Replay(tmp_path / "none.html")])).write(tmp_path / "report.html")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


def test_a_row_of_another_length_is_a_mistake() -> None:
    with pytest.raises(ValueError, match="2 cells in every row"):
        Report("T", "H").add(Section("S", [Table(["a", "b"], [["1"]])])).html()


@pytest.mark.slow
def test_a_browser_plays_the_replay_inside_the_page(tmp_path: Path) -> None:
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("needs Chromium to look at the page")
    path = full_report(tmp_path).write(tmp_path / "report.html")
    spy = """<script>setTimeout(() => { const d = document.querySelector("iframe").contentWindow;
      document.title = [d.viewer.animator.duration.toFixed(2), d.viewer.animator.actions.length,
        d.document.getElementById("wb-clock").textContent].join("|"); }, 5000)</script></body>"""
    path.write_text(path.read_text().replace("</body>", spy))
    flags = ["--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
             "--no-first-run", "--disable-background-networking", f"--user-data-dir={tmp_path / 'profile'}",
             "--virtual-time-budget=9000", "--dump-dom"]
    dom = subprocess.run([chromium, *flags, f"{path.as_uri()}#play"], capture_output=True, text=True, timeout=120).stdout
    (title,) = re.findall(r"<title>([^<]*)</title>", dom)[:1]
    duration, moving, clock = title.split("|")
    assert float(duration) == pytest.approx(1.44, abs=0.05)
    assert int(moving) > 10
    assert clock.endswith(" s")


def _curves(folder: Path) -> Path:
    model = small_robot(folder)
    take = swing(model)
    gap = replace(take, q=np.where(take.time[:, None] > 0.8, np.nan, take.q))
    section = Section("Joints", [Curves(swing(model, delay=0.05), gap, ("frb", "flm"), "Joint by joint.")])
    return Report("T", "H").add(section).write(folder / "curves.html")


def test_curves_hold_their_numbers_and_gaps(tmp_path: Path) -> None:
    html = _curves(tmp_path).read_text()
    outline = Outline()
    outline.feed(html)
    assert outline.open == []
    assert "http" not in html
    (packed,) = re.findall(r'<script type="application/json">([^<]+)</script>', html)
    content = json.loads(packed)
    assert list(content["joints"]) == list(content["errors"]) == ["frb", "flm"]
    assert list(content["joints"]["frb"]) == ["command", "measured", "simulated"]
    rows = len(content["time"])
    assert all(len(values) == rows for values in content["joints"]["flm"].values())
    late = int(np.argmax(np.array(content["time"]) > 0.81))
    assert content["joints"]["frb"]["measured"][late] is None
    assert content["errors"]["frb"][late] is None
    assert max(v for v in content["joints"]["flm"]["measured"] if v is not None) == pytest.approx(np.rad2deg(0.3), abs=0.1)


@pytest.mark.slow
def test_a_browser_reads_and_zooms_the_curves(tmp_path: Path) -> None:
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        pytest.skip("needs Chromium to look at the page")
    path = _curves(tmp_path)
    spy = """<script>setTimeout(() => { const c = document.querySelector("canvas"), at = () => {
      c.dispatchEvent(new PointerEvent("pointermove", {clientX: c.getBoundingClientRect().right - 12,
        clientY: c.getBoundingClientRect().top + 9})); return document.querySelector("output").textContent; };
      const all = at(); document.querySelector("[data-do=in]").click();
      document.title = all + "|" + at(); }, 500)</script></body>"""
    path.write_text(path.read_text().replace("</body>", spy))
    flags = ["--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}",
             "--virtual-time-budget=3000", "--dump-dom"]
    dom = subprocess.run([chromium, *flags, path.as_uri()], capture_output=True, text=True, timeout=120).stdout
    (title,) = re.findall(r"<title>([^<]*)</title>", dom)[:1]
    whole, zoomed = title.split("|")
    assert float(whole.split(" s:")[0]) > 1.1
    assert 0.5 < float(zoomed.split(" s:")[0]) < 0.95
    assert "simulated" in zoomed
