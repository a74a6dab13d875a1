"""Damage done to files: bytes, lines and numbers, as a seed says."""

from __future__ import annotations

import io
import random
import re
import zipfile

_TOKENS = [b"", b"0", b"-1", b"1e308", b"-1e308", b"1e-320", b"nan", b"inf", b"9" * 30, b"1_0", "\u0663".encode(), b"null", b"~",
           b'"', b"'", b"[", b"{", b"<", b">", b"&", b"\0", b"\r", b"\n", b"\xff\xfe", b"\xf6", b"!!int x", b"*a", b"&a", b"#",
           b",,", b";", b"1e25", b"4294967296", b"true", b"-0", b"\t", b"1,5", b"../../etc/passwd"]
_NUMBER = re.compile(rb"-?\d+\.?\d*(?:e-?\d+)?")


def mutated(content: bytes, seed: int) -> bytes:
    """`content` with one to four pieces of damage; of an archive half the time in a file that it holds, packed anew."""
    rng = random.Random(seed)
    if content.startswith(b"PK") and rng.random() < 0.5:
        return _repacked(content, rng)
    out = bytearray(content)
    for _ in range(rng.choice([1, 1, 2, 4])):
        rng.choice(_WAYS)(out, rng)
        del out[1 << 20:]
    return bytes(out)


def _repacked(content: bytes, rng: random.Random) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w") as new:
        names = old.namelist()
        for name, damaged in zip(names, rng.sample([True] + [False] * (len(names) - 1), len(names))):
            part = bytearray(old.read(name))
            if damaged:
                rng.choice(_WAYS)(part, rng)
            new.writestr(name, bytes(part))
    return out.getvalue()


def _flip(out: bytearray, rng: random.Random) -> None:
    if out:
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)


def _cut(out: bytearray, rng: random.Random) -> None:
    del out[rng.randrange(len(out) + 1):]


def _drop(out: bytearray, rng: random.Random) -> None:
    at = rng.randrange(len(out) + 1)
    del out[at:at + rng.choice([1, 4, 40])]


def _insert(out: bytearray, rng: random.Random) -> None:
    at = rng.randrange(len(out) + 1)
    out[at:at] = rng.choice(_TOKENS)


def _number(out: bytearray, rng: random.Random) -> None:
    """Another number, or none, where one stood."""
    found = list(_NUMBER.finditer(bytes(out[:1 << 16])))
    if found:
        hit = rng.choice(found)
        out[hit.start():hit.end()] = rng.choice(_TOKENS)


def _lines(out: bytearray, rng: random.Random) -> None:
    """Lines exchanged, doubled or left out."""
    lines = bytes(out).split(b"\n")
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    way = rng.randrange(3)
    if way == 0:
        lines[a], lines[b] = lines[b], lines[a]
    elif way == 1:
        lines.insert(a, lines[b])
    else:
        del lines[a]
    out[:] = b"\n".join(lines)


def _word(out: bytearray, rng: random.Random) -> None:
    """A word of the file in another's place."""
    words = list(re.finditer(rb"[A-Za-z_.]{2,}", bytes(out[:1 << 16])))
    if len(words) > 1:
        a, b = rng.sample(words, 2)
        out[a.start():a.end()] = b.group()


_WAYS = [_flip, _cut, _drop, _insert, _number, _number, _lines, _word]
