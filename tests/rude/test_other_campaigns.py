"""`flash` against a rude loader, `record` against rude cameras, and the runner of `make prove`."""

import json
import sys
from unittest.mock import patch

from tests.firmware.emulated_loader import Controller
from tests.rude import capture_campaign, loader_campaign, prove


def test_what_is_said_of_the_controller_is_true_whatever_happens_on_the_line():
    """300 faults."""
    struck, violated = loader_campaign.campaign(300)
    assert struck >= 300
    assert [f"{run}: {line}" for run, line in violated] == []


def test_a_take_is_blank_or_right_whatever_happens_on_the_network():
    """150 faults."""
    struck, violated = capture_campaign.campaign(150)
    assert struck >= 150
    assert [f"{run}: {line}" for run, line in violated] == []


def test_a_stream_that_stops_before_the_end_is_reported():
    """Found by the campaign: silence shorter than that which ends a recording was not."""
    assert capture_campaign.Run("stream ends", 28, 9650).play() == []


def test_each_fault_strikes():
    for fault in loader_campaign.FAULTS:
        run = loader_campaign.Run(fault, 40)
        run.play()
        assert run.struck, fault
    for fault in capture_campaign.FAULTS:
        run = capture_campaign.Run(fault, 5)
        run.play()
        assert run.struck, fault


def test_the_loaders_campaign_notices_a_wrong_sentence():
    """With the image said to be whole where the loader was only asked."""
    with patch.dict(loader_campaign.TRUTH, {said: {"new"} for said in loader_campaign.TRUTH}):
        assert loader_campaign.Run("cut", 40).play()
    line = loader_campaign.RudeLoader(Controller(), "cut", 3, 0, 0)
    assert line.controller.runs == "factory"


def test_pieces_are_kept_and_taken_up_again(tmp_path, capsys):
    argv = ["prove", "--faults", "40", "--workers", "1", "--out", str(tmp_path)]
    parts = {"loader": prove.PARTS["loader"]}
    kept = tmp_path / f"{prove.version()}.jsonl"
    first = {"part": "loader", "faults": 4, "seed": 1000, "struck": 4, "violated": ["planted"], "seconds": 0.1}
    kept.write_text(json.dumps(first) + "\n")
    with patch.object(sys, "argv", argv), patch.object(prove, "PARTS", parts):
        assert prove.main() == 1
    said = capsys.readouterr().out
    assert "loader, piece of seed 1000: planted" in said
    assert "4 faults (loader 4), 1 violations" in said
    kept.write_text("")
    with patch.object(sys, "argv", argv), patch.object(prove, "PARTS", parts), patch.object(prove, "ProcessPoolExecutor", _Here):
        assert prove.main() == 0
    (again,) = [json.loads(line) for line in kept.read_text().splitlines()]
    assert again["struck"] >= 4


def test_the_parts_make_up_what_was_asked_for():
    for faults in (2_000, 100_000):
        wanted = list(prove.pieces(faults))
        assert sum(n for _, n, _ in wanted) == faults
        assert {name for name, _, _ in wanted} == set(prove.PARTS)
        assert len(set(wanted)) == len(wanted)


class _Here:
    """A pool that works in this process."""

    def __init__(self, *_, **__):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def submit(self, call, *arguments):
        from concurrent.futures import Future

        future = Future()
        future.set_result(call(*arguments))
        return future
