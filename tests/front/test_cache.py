"""Values made once for a key."""

from __future__ import annotations

from workbench.cache import Cache


def test_a_value_is_made_once_and_the_one_that_was_not_asked_for_longest_is_dropped() -> None:
    made: list[str] = []

    def make(value: str) -> str:
        made.append(value)
        return value

    cache: Cache[str] = Cache(2)
    for key in "aabacab":
        assert cache.get(key, lambda key=key: make(key)) == key  # type: ignore[misc]
    assert made == ["a", "b", "c", "b"]


def test_objects_whose_ids_are_in_a_key_are_held() -> None:
    cache: Cache[int] = Cache(8)
    for k in range(8):
        of = [k]
        assert cache.get(id(of), lambda k=k: k, held=of) == k  # type: ignore[misc]
