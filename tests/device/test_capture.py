"""Takes from an emulated Motive: in virtual time, and over sockets."""

import json
import math
import re
import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pytest

from tests.command import refused, succeeds
from tests.device.motive import NAMES, MotiveOnSockets, scene
from workbench.device.capture import Recorder, UdpLink, finish, record_take
from workbench.device.capture.journal import Journal
from workbench.device.capture.packets import BrokenPacketError, parse_frame, parse_server_info
from workbench.device.capture.stream import Stream
from workbench.device.virtual.motive import Faults, VirtualLink, VirtualMotive
from workbench.files import InputError
from workbench.recording.formats.read import read_recording

VERSIONS = [(2, 7), (2, 10), (3, 0), (3, 1), (4, 0), (4, 1), (4, 2), (4, 4)]
MANY = Faults(lost=0.02, broken=0.01, doubled=0.01, swapped=0.01)
FAULTS = Faults(lost=0.01, broken=0.001, doubled=0.001, swapped=0.001)


def recorded(tmp_path, motive, seconds):
    return record_take(Recorder(VirtualLink(motive)), tmp_path / "take.csv", lambda: False, seconds)


def within(counts, numbers):
    return len({n for n in numbers if counts.first < n < counts.last})


def check(capture, motive):
    """Counts exact, times within a millisecond, poses right, unseen bodies blank."""
    counts, sent = capture.counts, motive.sent
    assert counts.lost == within(counts, sent.lost)
    assert counts.broken == len({n for n in sent.broken if counts.first <= n <= counts.last})
    overtaken = {n for n in sent.swapped if n + 1 not in sent.lost | sent.broken | sent.swapped}
    assert counts.late == within(counts, overtaken)
    assert abs(counts.doubled - within(counts, sent.doubled)) <= (counts.last in sent.doubled)
    recording = read_recording(capture.take)
    assert len(recording.time) == counts.last - counts.first + 1
    exposed = [motive.mid_exposure(counts.first + int(n)) - motive.mid_exposure(counts.first) for n in recording.frames]
    assert np.max(np.abs(recording.time - exposed)) < 1e-3
    assert capture.first_time == pytest.approx(motive.mid_exposure(counts.first), abs=1e-6)
    gone = sent.lost | sent.broken
    begin = (counts.first - motive.first_number) / motive.rate
    for k in range(0, len(recording.time), 7):
        t, number = begin + k / motive.rate, counts.first + k
        for name in ("body0", "body3", "body13"):
            p, quat, seen = scene(t)[name]
            track = recording.rigid_bodies[name]
            if number in gone or not seen:
                assert np.isnan(track.p[k]).all()
                assert np.isnan(track.quat[k]).all()
            else:
                np.testing.assert_allclose(track.p[k], p, atol=2e-6)
                np.testing.assert_allclose(track.quat[k], [quat[3], *quat[:3]], atol=2e-6)


@pytest.mark.parametrize("group", ["239.255.42.99", None], ids=["multicast", "unicast"])
@pytest.mark.parametrize("version", VERSIONS, ids=lambda v: f"{v[0]}.{v[1]}")
def test_each_version_is_recorded_exactly(tmp_path, version, group):
    motive = VirtualMotive(NAMES, scene, version=version, group=group, faults=MANY, seed=version[1], started=77.0)
    capture = recorded(tmp_path, motive, 1.5)
    check(capture, motive)
    assert (motive.keep_alives > 0) == (group is None or version < (3, 0))
    assert not (tmp_path / "take.natnet").exists()
    report = json.loads((tmp_path / "take.capture.json").read_text())
    assert report["server"]["version"] == list(version)
    assert report["motive_recording"] == "recorded as 'take'"
    assert motive.take_name == "take"
    assert not motive.recording, "stopped at the end"


def test_twenty_seconds_with_faults(tmp_path):
    motive = VirtualMotive(NAMES, scene, version=(4, 2), faults=Faults(0.01, 0.01, 0.01, 0.01), seed=5, started=3.0)
    capture = recorded(tmp_path, motive, 20.0)
    check(capture, motive)
    assert capture.counts.lost > 20
    assert min(capture.counts.broken, capture.counts.late, capture.counts.doubled) > 20
    assert capture.gaps["body3"] > capture.gaps["body0"]
    assert len(json.loads((tmp_path / "take.capture.json").read_text())["broken_packets"]) == 20


@pytest.mark.slow
def test_ten_minutes_with_faults(tmp_path):
    motive = VirtualMotive(NAMES, scene, version=(4, 1), faults=FAULTS, seed=6, clock_ratio=1 + 30e-6)
    capture = recorded(tmp_path, motive, 600.0)
    check(capture, motive)
    assert capture.counts.last - capture.counts.first > 143_000


def test_the_servers_clock_is_found(tmp_path):
    """A clock that is 1000 s ahead and runs 50 ppm fast, seen through a link with 0.2 ms each way."""
    motive = VirtualMotive(NAMES[:2], scene_of_two, started=12.0, clock=1012.0, clock_ratio=1 + 50e-6)
    capture = recorded(tmp_path, motive, 15.0)
    begin = 12.0 + (capture.counts.first - motive.first_number) / motive.rate
    assert capture.first_host == pytest.approx(begin, abs=1e-5)
    assert capture.clock.offset == pytest.approx(1000.0, abs=1e-4)
    assert capture.clock.drift == pytest.approx(50e-6, abs=1e-6)
    assert capture.clock.within == pytest.approx(0.2e-3, rel=0.01)
    assert capture.rate == pytest.approx(240 / (1 + 50e-6), rel=1e-9)


def test_without_echo_the_clock_is_that_of_arrivals(tmp_path):
    motive = VirtualMotive(NAMES, scene, version=(2, 10), started=12.0)
    capture = recorded(tmp_path, motive, 2.0)
    begin = 12.0 + (capture.counts.first - motive.first_number) / motive.rate
    assert 0 < capture.first_host - begin < 0.01
    assert any("no echo" in problem for problem in capture.problems)
    assert json.loads((tmp_path / "take.capture.json").read_text())["clock"] is None


def test_every_cut_of_a_frame_is_refused():
    for version in VERSIONS:
        motive = VirtualMotive(NAMES[:2], scene_of_two, version=version)
        info = parse_server_info(motive._server_info())
        (_, whole), *_ = motive.due(0.006)
        assert parse_frame(whole, info).number == motive.first_number
        for size in range(len(whole)):
            for data in (whole[:size], whole[:2] + (size - 4).to_bytes(2, "little", signed=True) + whole[4:size]):
                with pytest.raises(BrokenPacketError):
                    parse_frame(data, info)


def scene_of_two(t):
    return {name: pose for name, pose in scene(t).items() if name in NAMES[:2]}


def test_random_packets_end_nothing(tmp_path):
    """Random packets and flipped bits: none ends the recording, and the take can be finished."""
    rng = np.random.default_rng(0)
    motive = VirtualMotive(NAMES[:2], scene_of_two, version=(4, 1))
    recorder = Recorder(VirtualLink(motive))
    recorder.connect()
    with Journal(tmp_path / "t.natnet") as journal:
        recorder.listen(journal, lambda: False, seconds=0.2)
        before = recorder.counts
        kinds = [*range(16), 100]
        for _ in range(1500):
            body = rng.integers(0, 256, int(rng.integers(0, 300)), dtype=np.uint8).tobytes()
            recorder._take(journal, 1.0, int(rng.choice(kinds)).to_bytes(2, "little") + len(body).to_bytes(2, "little") + body)
        for _ in range(500):
            ((_, frame),) = motive.due(recorder.link.now() + 1)[-1:] or [(0.0, b"")]
            data = bytearray(frame or bytes(40))
            data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
            recorder._take(journal, 1.0, bytes(data))
    assert recorder.counts.broken > before.broken
    assert finish(tmp_path / "t.natnet", tmp_path / "t.csv").counts.received >= before.received


def test_late_lost_and_doubled_frames_are_told_apart():
    stream = Stream()
    assert [stream.count(n) for n in (10, 11, 13, 12, 13, 17, 90_000)] == [True, True, True, True, False, True, False]
    assert (stream.jumps, stream.jumped_to) == (1, 90_000)
    stream.count_broken(15)
    stream.count_broken(13)
    counts = stream.counts()
    assert (counts.first, counts.last, counts.received, counts.late, counts.doubled) == (10, 17, 5, 1, 1)
    assert (counts.broken, counts.lost) == (2, 2), "14 and 16; 15 came, though broken"


def test_a_stream_that_starts_anew_ends_the_recording(tmp_path):
    motive = VirtualMotive(NAMES, scene)
    link = VirtualLink(motive)

    def until():
        if link.now() > 1.0:
            motive.first_number = 900_000
        return False

    capture = record_take(Recorder(link), tmp_path / "take.csv", until, 10.0)
    assert any("restarted or plays back" in problem for problem in capture.problems)
    assert 200 < capture.counts.received < 300


def test_a_stream_that_stops_ends_the_recording(tmp_path):
    motive = VirtualMotive(NAMES, scene)
    link = VirtualLink(motive)

    def until():
        if link.now() > 1.0:
            motive.rate = 1e-9
        return False

    capture = record_take(Recorder(link), tmp_path / "take.csv", until, 100.0)
    assert any("the stream stopped" in problem for problem in capture.problems)


def test_motive_that_refuses_to_record_is_a_warning(tmp_path):
    motive = VirtualMotive(NAMES, scene)
    motive._command = lambda text: b"\x03\x00\x04\x00\x01\x00\x00\x00"
    capture = recorded(tmp_path, motive, 0.5)
    assert any("refused with code 1" in problem for problem in capture.problems)


@pytest.mark.parametrize("group", ["239.255.42.99", None], ids=["multicast", "unicast"])
def test_over_sockets(tmp_path, capsys, group):
    with MotiveOnSockets(group=group, version=(3, 1), faults=Faults(lost=0.02), seed=2) as server:
        said = succeeds(capsys, "record", "127.0.0.1", "--port", str(server.port), "--seconds", "1.5", "--out", str(tmp_path))
    report = json.loads((tmp_path / "take.capture.json").read_text())
    frames = report["frames"]
    hit = {n for n in server.motive.sent.lost if frames["first"] < n < frames["last"]}
    assert frames["lost"] == len(hit) > 0
    assert f"{frames['lost']} lost" in said
    began = server.motive.started + (frames["first"] - server.motive.first_number) / 240
    assert report["first_frame"]["host_monotonic"] == pytest.approx(began, abs=0.02)


def test_kill_loses_at_most_a_second(tmp_path, capsys):
    with MotiveOnSockets(version=(4, 1)) as server:
        process = recording(server, tmp_path)
        journal = tmp_path / "take.natnet"
        wait_for(lambda: journal.exists() and journal.stat().st_size > 300_000)
        process.kill()
        killed = time.monotonic()
        process.communicate()
    assert process.returncode == -signal.SIGKILL
    assert not (tmp_path / "take.csv").exists()
    line = refused(capsys, "record", "127.0.0.1", "--port", str(server.port), "--out", str(tmp_path / "other"))
    assert "no answer from Motive" in line
    succeeds(capsys, "record", "--finish", str(journal), "--out", str(tmp_path))
    report = json.loads((tmp_path / "take.capture.json").read_text())
    last = report["first_frame"]["host_monotonic"] + (report["frames"]["last"] - report["frames"]["first"]) / report["rate"]
    assert killed - last < 1.0
    assert read_recording(tmp_path / "take.csv").rate == pytest.approx(240, rel=1e-3)
    with MotiveOnSockets(version=(4, 1)) as server:
        line = refused(capsys, "record", "127.0.0.1", "--port", str(server.port), "--out", str(tmp_path))
    assert "take.natnet: a recording that was cut short; finish it with" in line


def test_interrupted_recording_is_finished(tmp_path):
    with MotiveOnSockets(version=(4, 1)) as server:
        process = recording(server, tmp_path)
        journal = tmp_path / "take.natnet"
        wait_for(lambda: journal.exists() and journal.stat().st_size > 100_000)
        process.send_signal(signal.SIGHUP)
        out, err = process.communicate()
    assert process.returncode == 0, err
    assert "wrote" in out
    assert (tmp_path / "take.csv").exists()
    assert not journal.exists()


def recording(server, out):
    """The command, started as a user would."""
    command = [sys.executable, "-m", "workbench.cli.main", "record", "127.0.0.1", "--port", str(server.port), "--out", str(out)]
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def wait_for(true, seconds=30.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.02)


def test_what_is_wrong_is_one_line(tmp_path, capsys):
    out = ("--out", str(tmp_path))
    assert "expected either HOST or --finish" in refused(capsys, "record", *out)
    assert "'no.such.host.invalid': not a known host" in refused(capsys, "record", "no.such.host.invalid", *out)
    line = refused(capsys, "record", "127.0.0.1", "--interface", "198.51.100.7", *out)
    assert "interface '198.51.100.7': not an address of this machine; expected one of" in line
    assert "127.0.0.1" in line
    (tmp_path / "x").write_bytes(b"nothing of the kind")
    assert "not a recording cut short" in refused(capsys, "record", "--finish", str(tmp_path / "x"), *out)
    with MotiveOnSockets(mute=True) as server:
        line = refused(capsys, "record", "127.0.0.1", "--port", str(server.port), *out)
    assert re.search(r"no frame came in \d+\.\d s by multicast group 239\.255\.42\.99", line)
    assert "through interface 127.0.0.1 (chosen by the route to it; this machine has" in line
    assert "--interface" in line
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x"]


def test_motive_is_asked_for_nothing_where_the_take_cannot_be_written(tmp_path, capsys):
    (tmp_path / "x").write_text("a file")
    with MotiveOnSockets(version=(4, 1)) as server:
        line = refused(capsys, "record", "127.0.0.1", "--port", str(server.port), "--out", str(tmp_path / "x" / "out"))
    assert "x/out/take.natnet: cannot be written" in line
    assert server.client is None


def test_a_recording_without_frames_leaves_nothing(tmp_path):
    """Neither folders, nor a journal that is in the way of the next recording and that --finish refuses."""
    with MotiveOnSockets(mute=True) as server, pytest.raises(InputError, match="no frame came"):
        record_take(Recorder(UdpLink("127.0.0.1", command_port=server.port)), tmp_path / "a/b/take.csv", lambda: False)
    with pytest.raises(InputError, match="stopped after 0 whole frames; expected 2 or more"):
        record_take(Recorder(VirtualLink(VirtualMotive(NAMES, scene))), tmp_path / "a/b/take.csv", lambda: True)
    assert not list(tmp_path.iterdir())


def test_a_server_too_old_or_none_is_named():
    motive = VirtualMotive(NAMES, scene, version=(2, 5))
    with pytest.raises(InputError, match=r"streams NatNet 2\.5; expected 2\.7 to 4\.x"):
        Recorder(VirtualLink(motive)).connect()
    motive = VirtualMotive(NAMES, scene)
    motive.answer = lambda data, now: []
    with pytest.raises(InputError, match="no answer from Motive in 3 s"):
        Recorder(VirtualLink(motive)).connect()


def test_a_take_begins_when_it_was_taken(tmp_path):
    capture = recorded(tmp_path, VirtualMotive(NAMES, scene, started=time.monotonic()), 0.5)
    report = json.loads((tmp_path / "take.capture.json").read_text())
    assert math.isfinite(capture.first_host)
    assert report["first_frame"]["utc"].endswith("+00:00")
    assert read_recording(capture.take).metadata["Capture Start Time"]


def test_sockets_are_let_go(tmp_path):
    with MotiveOnSockets() as server:
        from workbench.device.capture import UdpLink

        record_take(Recorder(UdpLink("127.0.0.1", command_port=server.port)), tmp_path / "a.csv", lambda: False, 0.3)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as again:
            again.bind(("239.255.42.99", server.data_port))


def test_frames_of_a_second_server_on_the_group_are_left_out():
    with MotiveOnSockets(version=(4, 1)) as server, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        link = UdpLink("127.0.0.1", "127.0.0.1", server.port)
        other.bind(("127.0.0.2", 0))
        other.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        Recorder(link).connect()
        heard = set()
        for _ in range(200):
            received = link.receive(0.05)
            if received is not None:
                other.sendto(b"foreign", (server.group, server.data_port))
                heard.add(received[1] == b"foreign")
            if len(link.others) and heard:
                break
        link.close()
    assert heard == {False}
    assert link.others == {"127.0.0.2"}
