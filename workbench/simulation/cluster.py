"""Work in blocks on a cluster, if the caller has chosen one by `joblib.parallel_config`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import Any, TypeVar

T = TypeVar("T")


def on_cluster() -> bool:
    """Whether jobs are to run on another backend of joblib's than processes of this machine, such as Dask."""
    from joblib.parallel import get_active_backend

    return get_active_backend()[0].__class__.__name__ != "LokyBackend"


def in_blocks(function: Callable[[Sequence[Any]], list[T]], items: Sequence[Any], n_jobs: int) -> Iterator[T]:
    """Results of a function that takes several items and returns one result for each, in their order.

    Each worker gets one block of neighbouring items: a rollout takes milliseconds, about as long as a scheduler needs for a task.
    function and items: importable, so that workers can load them. n_jobs: least number of blocks, if there are as many items.
    """
    from joblib import Parallel, delayed, effective_n_jobs

    count = max(1, min(len(items), max(n_jobs, effective_n_jobs(-1))))
    ends = [round(k * len(items) / count) for k in range(count + 1)]
    blocks = [items[a:b] for a, b in pairwise(ends)]
    for results in Parallel(n_jobs=n_jobs, return_as="generator")(delayed(function)(block) for block in blocks):
        yield from results
