"""A cache of the values that were used last."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from contextlib import suppress
from typing import Generic, TypeVar

T = TypeVar("T")


class Cache(Generic[T]):
    """Values by key; beyond `most`, the one that was asked for longest ago is dropped. Threads may share a cache: two that ask
    for the same value at once both make it."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._kept: OrderedDict[Hashable, tuple[object, T]] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], T], held: object = None) -> T:
        """The value of a key, made at the first call. held: objects whose ids are in the key; they are kept with the value, so
        that no other object gets their ids."""
        found = self._kept.get(key)
        if found is None:
            found = self._kept[key] = held, make()
            while len(self._kept) > self.most:
                self._kept.popitem(last=False)
        with suppress(KeyError):  # another thread may have dropped it
            self._kept.move_to_end(key)
        return found[1]
