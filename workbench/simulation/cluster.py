"""Work in other processes or, if the caller has chosen one by `joblib.parallel_config`, on a cluster."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any, Literal, TypeVar

T = TypeVar("T")


def on_cluster() -> bool:
    """Whether jobs are to run on another backend of joblib's than processes of this machine, such as Dask."""
    from joblib.parallel import get_active_backend

    return get_active_backend()[0].__class__.__name__ != "LokyBackend"


def stream_results(calls: Iterable[Any], n_jobs: int, batch_size: int | Literal["auto"] = "auto") -> Iterator[Any]:
    """Results of calls that `joblib.delayed` made, in their order, each as soon as it and those before it are done. A caller that
    stops early cancels the rest. batch_size: calls sent to a worker at once."""
    from joblib import Parallel

    with warnings.catch_warnings():  # joblib restarts a worker that has grown and says so: nothing is lost
        warnings.filterwarnings("ignore", message="A worker stopped while some jobs")
        results = Parallel(n_jobs=n_jobs, return_as="generator", batch_size=batch_size)(calls)
        try:
            for result in results:  # noqa: UP028  # `yield from` would close the results itself, with their warning
                yield result
        finally:
            with warnings.catch_warnings():  # about results that a caller who stopped early does not want
                warnings.simplefilter("ignore")
                results.close()


def in_blocks(function: Callable[[Sequence[Any]], list[T]], items: Sequence[Any], n_jobs: int) -> Iterator[T]:
    """Results of a function that takes several items and returns one result for each, in their order.

    Each worker gets one block of neighbouring items: a rollout takes milliseconds, about as long as a scheduler needs for a task.
    function and items: importable, so that workers can load them. n_jobs: least number of blocks, if there are as many items.
    """
    from joblib import delayed, effective_n_jobs

    count = max(1, min(len(items), max(n_jobs, effective_n_jobs(-1))))
    ends = [round(k * len(items) / count) for k in range(count + 1)]
    blocks = [items[a:b] for a, b in pairwise(ends)]
    for results in stream_results((delayed(function)(block) for block in blocks), n_jobs):
        yield from results
