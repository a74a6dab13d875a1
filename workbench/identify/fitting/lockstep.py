"""Parts of a search that run in lockstep: generators that yield their requests, are sent the answers, and return a result."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from typing import Any, TypeVar

T = TypeVar("T")


def through(part: Generator[list[Any], list[Any], T], ask: Callable[[Any], Any], tell: Callable[[Any], Any]
            ) -> Generator[list[Any], list[Any], T]:
    """A generator as part of another: its requests are passed on through `ask`, the answers through `tell`."""
    try:
        wants = next(part)
        while True:
            answers = yield [ask(w) for w in wants]
            wants = part.send([tell(a) for a in answers])
    except StopIteration as end:
        return end.value  # type: ignore[no-any-return]


def side_by_side(parts: Sequence[Generator[list[Any], list[Any], Any]], report: Callable[[float], None] = lambda share: None
                 ) -> Generator[list[Any], list[Any], list[Any]]:
    """Several generators as one, which yields the requests of every one together. Returns the result of each."""
    done: dict[int, Any] = {}
    wants: dict[int, list[Any]] = {}

    def advance(k: int, sent: list[Any] | None) -> None:
        try:
            wants[k] = next(parts[k]) if sent is None else parts[k].send(sent)
        except StopIteration as end:
            wants.pop(k, None)
            done[k] = end.value

    for k in range(len(parts)):
        advance(k, None)
    while wants:
        report(len(done) / len(parts))
        answers = iter((yield [want for wanted in wants.values() for want in wanted]))
        for k, wanted in list(wants.items()):
            advance(k, [next(answers) for _ in wanted])
    return [done[k] for k in range(len(parts))]


def together(asking: Mapping[T, Generator[list[Any], list[Any], Any]], answer: Callable[[list[tuple[T, Any]]], list[Any]],
             report: Callable[[float], None] = lambda share: None) -> dict[T, Any]:
    """Runs generators in lockstep: all their requests, each with its generator's key, are answered in one call. Returns the
    result of each."""
    def with_key(key: T, part: Generator[list[Any], list[Any], Any]) -> Generator[list[Any], list[Any], Any]:
        return through(part, lambda want: (key, want), lambda given: given)

    parts = side_by_side([with_key(*each) for each in asking.items()], report)
    try:
        wanted = next(parts)
        while True:
            wanted = parts.send(answer(wanted))
    except StopIteration as end:
        return dict(zip(asking, end.value))
