"""Frames: Python and the firmware's C find the same ones in the same bytes; messages of any content raise nothing."""

from __future__ import annotations

import ctypes

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.firmware.native import core
from workbench.device.link import PAYLOAD, Frame, FrameReader, FrameType, decode_message, encode_frame


def found_by_c(data: bytes) -> list[Frame]:
    """Frames that core/frame.c finds."""
    lib = core()
    lib.frame_feed.restype = ctypes.c_bool
    reader = ctypes.create_string_buffer(256)
    found = []
    for value in data:
        if lib.frame_feed(reader, value):
            kind, number, length = reader.raw[:3]
            found.append(Frame(kind, number, reader.raw[3:3 + length]))
    return found


frames = st.builds(encode_frame, st.integers(0, 255), st.binary(max_size=PAYLOAD), st.integers(0, 255))
noise = st.one_of(st.binary(max_size=12), st.sampled_from([b"\xa5", b"\xa5\x5a", b"\xa5\xa5\x5a", b"\xa5\x5a\x01\x02\xff"]))


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.lists(st.one_of(frames, noise), max_size=8), st.lists(st.tuples(st.integers(0, 2000), st.integers(0, 7)), max_size=3))
def test_python_finds_what_c_finds(parts: list[bytes], flips: list[tuple[int, int]]) -> None:
    data = bytearray(b"".join(parts))
    for at, bit in flips:
        if at < len(data):
            data[at] ^= 1 << bit
    found = iter(FrameReader().feed(bytes(data)))
    assert all(f in found for f in found_by_c(bytes(data)))  # in their order; Python also finds what a broken frame hides


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.lists(frames, min_size=1, max_size=4), frames, st.integers(1, 220), st.integers(1, 50))
def test_a_frame_that_was_cut_hides_none_of_those_behind_it(parts: list[bytes], other: bytes, cut: int, step: int) -> None:
    """As a reset in the middle of a log, before the one frame that says why. Where just one byte is missing, the next frame's
    first may happen to be it: then nobody can tell."""
    data, reader = other[:min(cut, len(other) - 1)] + b"".join(parts) + bytes(220), FrameReader()
    assume(not data.startswith(other))
    found = [f for at in range(0, len(data), step) for f in reader.feed(data[at:at + step])]
    assert [encode_frame(f.type, f.payload, f.number) for f in found] == parts


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.lists(frames, min_size=1, max_size=6), st.integers(1, 50))
def test_whole_frames_are_all_found_however_they_are_cut(parts: list[bytes], step: int) -> None:
    data, reader = b"".join(parts), FrameReader()
    found = [f for at in range(0, len(data), step) for f in reader.feed(data[at:at + step])]
    assert [encode_frame(f.type, f.payload, f.number) for f in found] == parts


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.sampled_from(list(FrameType)), st.integers(0, 255), st.binary(max_size=PAYLOAD))
def test_no_content_of_a_frame_raises(kind: FrameType, number: int, payload: bytes) -> None:
    decode_message(Frame(kind, number, payload))


def test_a_payload_that_is_too_long_is_refused() -> None:
    with pytest.raises(ValueError, match="205 bytes"):
        encode_frame(1, bytes(205))
