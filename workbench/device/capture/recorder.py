"""Listens to a Motive server and keeps every packet."""

from __future__ import annotations

import datetime
import json
import math
import struct
from collections.abc import Callable
from dataclasses import dataclass

from workbench.device.capture.journal import Journal
from workbench.device.capture.link import Link
from workbench.device.capture.packets import HIRES, OLDEST, BodyPose, BrokenPacketError, Message, ServerInfo, kind_of, packet
from workbench.device.capture.stream import Counts, Stream
from workbench.files import InputError
from workbench.types import Progress

RESTARTED = 10
"""Frames in a row that are of another stream: then Motive was restarted or plays back."""


@dataclass(frozen=True)
class RecordOptions:
    """Times of the conversation with the server [s]."""

    answer: float = 1.0
    """Until a question is asked again; a local network answers in milliseconds."""
    questions: int = 3
    """How often it is asked: packets get lost."""
    first_frame: float = 3.0
    """Until a server that sends no frame is an error: at the slowest rate of a camera (30 Hz) that is 90 frames."""
    silence: float = 5.0
    """Until a stream that stopped ends the recording."""
    echo_every: float = 0.5
    """Between measurements of the server's clock; the best of a few is kept."""
    trailing: float = 0.25
    """Silence at the end of a recording that is reported: seven frames at 30 Hz, the slowest rate."""
    keep_alive_every: float = 1.0
    """Between signs of life, without which a server that sends to each client alone stops after some seconds."""


class Recorder:
    """One conversation with a server, recorded into a journal. `connect`, then `listen` until enough has come. latest: of each
    rigid body the last pose, and when it arrived [s]. problem: why the recording ended early."""

    def __init__(self, link: Link, options: RecordOptions | None = None) -> None:
        self.link, self.options = link, options or RecordOptions()
        self.latest: dict[str, tuple[float, BodyPose]] = {}
        self.problem = ""
        self._stream = Stream()
        self._descriptions: list[bytes] = []
        self._tracked = 0
        self._last_frame = self._echoed = self._alive = self._asked = -math.inf

    @property
    def info(self) -> ServerInfo:
        """Description of the server."""
        assert self._stream.info is not None, "connect first"
        return self._stream.info

    @property
    def names(self) -> dict[int, str]:
        """Names of the rigid bodies by their numbers."""
        return self._stream.names

    @property
    def counts(self) -> Counts:
        """Counts of the frames so far."""
        return self._stream.counts()

    @property
    def counts_received(self) -> bool:
        """Whether any frame has come."""
        return self._stream.last >= 0

    def connect(self) -> ServerInfo:
        """Finds the server and the names of its assets; InputError in one line where it does not answer, or is too old."""
        patience = self.options.answer * self.options.questions
        self._learn(Message.CONNECT, b"Ping\0", Message.SERVER_INFO,
                    f"no answer from Motive in {patience:g} s; is streaming on in Motive (Settings, Streaming), on that "
                    "interface, and does a firewall let UDP 1510 and 1511 pass?")
        info = self.info
        if not (OLDEST <= info.version < (5, 0)):
            version = "{}.{}".format(*info.version)
            raise self._error(f"{info.application} {info.application_version} streams NatNet {version}; expected 2.7 to 4.x")
        if info.version >= HIRES and not info.clock_frequency > 0:
            raise self._error(f"{info.application} does not say how fast its clock ticks")
        self.link.subscribe(info)
        self._learn(Message.REQUEST_MODELDEF, b"", Message.MODELDEF,
                    "Motive answers, but does not describe its assets; is 'Rigid Bodies' on in its streaming settings?")
        return info

    def _learn(self, question: Message, payload: bytes, answer: Message, silence: str) -> None:
        """Asks for a description; it belongs to the recording as well."""
        data = self._ask(question, payload, answer)
        if data is None:
            raise self._error(silence)
        self._stream.take(self.link.now(), data)
        if self._stream.broken:
            raise self._error(f"answers, but not as a NatNet server ({self._stream.problem})")
        self._descriptions.append(data)

    def request_recording(self, name: str) -> str:
        """Asks Motive to record the take itself, under this name; "" where it does, else its answer."""
        for command in (f"SetRecordTakeName,{name}", "StartRecording"):
            refusal = self._command(command)
            if refusal:
                return f"'{command}': {refusal}"
        return ""

    def stop_recording(self) -> str:
        """Ends Motive's own recording."""
        return self._command("StopRecording")

    def listen(self, journal: Journal, until: Callable[[], bool], progress: Progress | None = None,
               seconds: float | None = None) -> Counts:
        """Records until `until()`, or so many seconds after the first frame; InputError where no frame comes at all.

        A stream that stops, or restarts with other numbers, ends it; `problem` then states the reason.
        """
        self._begin(journal)
        began, first = self.link.now(), math.inf
        while not until() and not self.problem:
            received = self.link.receive(0.05)
            now = self.link.now()
            if received is not None:
                self._take(journal, *received)
            if math.isinf(first) and self.counts_received:
                first = now
            if seconds is not None and now - first >= seconds:
                break
            self._stay_in_touch(now)
            self._check_silence(now - began, now - self._last_frame)
            if progress is not None:
                progress(self._describe_stage(), None if seconds is None or math.isinf(first) else (now - first) / seconds)
        quiet = self.link.now() - self._last_frame
        if self.counts_received and not self.problem and quiet > self.options.trailing:
            self.problem = f"no frame came in the last {quiet:.1f} s of the recording"
        return self.counts

    def _begin(self, journal: Journal) -> None:
        """The note and the descriptions, without which frames cannot be read."""
        now = self.link.now()
        note = {"link": self.link.description, "arrival": now, "utc": datetime.datetime.now(datetime.UTC).isoformat()}
        for data in (packet(Message.NOTE, json.dumps(note).encode()), *self._descriptions):
            journal.packet(now, data)

    def _describe_stage(self) -> str:
        c = self.counts
        bodies = f"{self._tracked} of {len(self.names)} bodies"
        return f"recording, {c.received} frames, {c.lost} lost, {c.broken} broken, {bodies}"

    def _take(self, journal: Journal, arrival: float, data: bytes) -> None:
        """Takes one packet, whatever it holds."""
        journal.packet(arrival, data)
        known, broken = len(self.names), self.counts.broken
        frame = self._stream.take(arrival, data)
        if frame is not None or self.counts.broken > broken:
            self._last_frame = arrival
        if len(self.names) > known:
            self._asked = -math.inf
        if self._stream.jumps > RESTARTED:
            self.problem = (f"the stream jumped from frame {self._stream.last} to {self._stream.jumped_to}: Motive was restarted "
                            "or plays back; the frames before are kept")
        if frame is None:
            return
        self.latest |= {self.names[b.id]: (arrival, b) for b in frame.bodies if b.id in self.names}
        self._tracked = sum(body.tracked for body in frame.bodies)
        unknown = any(body.id not in self.names for body in frame.bodies)
        if (frame.models_changed or unknown) and arrival - self._asked > self.options.answer:
            self._asked = arrival
            self.link.send(packet(Message.REQUEST_MODELDEF))

    def _stay_in_touch(self, now: float) -> None:
        if self.info.version >= HIRES and now - self._echoed >= self.options.echo_every:
            self._echoed = now
            self.link.send(packet(Message.ECHO_REQUEST, struct.pack("<Q", round(now * 1e9))))
        alone = self.info.group is None or self.info.version < HIRES  # the latter do not say
        if alone and now - self._alive >= self.options.keep_alive_every:
            self._alive = now
            self.link.send(packet(Message.KEEP_ALIVE))

    def _check_silence(self, since_begin: float, since_frame: float) -> None:
        if not self.counts_received and since_begin > self.options.first_frame:
            broken = self.counts.broken
            way = f"multicast group {self.info.group}" if self.info.group else "unicast"
            what = f"{broken} packets came and none could be read" if broken else "no frame came"
            raise self._error(f"{what} in {since_begin:.1f} s by {way}; is Motive live, and streaming on that interface? Choose "
                              "another with --interface")
        if self.counts_received and since_frame > self.options.silence:
            self.problem = f"the stream stopped: no frame for {since_frame:.1f} s"

    def _error(self, problem: str) -> InputError:
        return InputError(None, f"{self.link.description}: {problem}")

    def _command(self, text: str) -> str:
        data = self._ask(Message.REQUEST, text.encode() + b"\0", Message.RESPONSE)
        if data is None:
            return "no answer"
        if len(data) == 8:
            (code,) = struct.unpack_from("<i", data, 4)
            return "" if code == 0 else f"refused with code {code}"
        return ""

    def _ask(self, question: Message, payload: bytes, answer: Message) -> bytes | None:
        """The answer to a question, asked again where none comes; frames in between are nobody's yet."""
        for _ in range(self.options.questions):
            self.link.send(packet(question, payload))
            end = self.link.now() + self.options.answer
            while self.link.now() < end:
                received = self.link.receive(0.05)
                if received is None:
                    continue
                try:
                    kind = kind_of(received[1])
                except BrokenPacketError:
                    continue
                if kind == answer:
                    return received[1]
                if kind == Message.UNRECOGNIZED_REQUEST:
                    return packet(answer, struct.pack("<i", 1))
        return None
