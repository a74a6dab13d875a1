"""A cache of the values that were made last."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

T = TypeVar("T")


class Cache(Generic[T]):
    """Values by key; beyond `most`, the oldest is dropped. Threads may share a cache: two that ask for the same value at
    once both make it."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._kept: OrderedDict[Hashable, tuple[object, T]] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], T], held: object = None) -> T:
        """The value of a key, made at the first call. held: objects whose ids are in the key; they are kept with the value, so
        that no other object gets their ids."""
        found = self._kept.get(key)
        if found is None:  # returned from here, as another thread may drop it
            found = self._kept[key] = held, make()
            while len(self._kept) > self.most:
                self._kept.popitem(last=False)
        return found[1]
