"""Batches of cases on a Ray cluster; a worker or a node that dies loses no case, its batch runs elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from experiments.bench_cases import Case, Maker
from experiments.ray_cluster import connected, results_of
from steer_env.plants import Reference

Result = dict[str, Any]
Batch = tuple[Case, ...]


def driven_on_cluster(
    batches: Sequence[Batch], reference: Reference, seed: int, makers: Mapping[str, Maker], address: str
) -> Iterator[tuple[Batch, list[Result]]]:
    """(Batch, its results) as they are finished; ``address`` as ray.init takes it.

    Every node needs this package; makers and the modules of a user's own controllers travel by value.
    InputError where Ray is missing or does not answer.
    """
    from experiments.bench_run import drive

    ray = connected(address)
    for make in makers.values():
        module = sys.modules.get(getattr(make, "__module__", ""))
        if module is not None and module.__name__.startswith("own_controller_"):
            ray.cloudpickle.register_pickle_by_value(module)
    shared = ray.put(reference)
    jobs = {batch: (batch, shared, seed, makers.get(batch[0].controller)) for batch in batches}
    yield from results_of(drive, jobs, address)
