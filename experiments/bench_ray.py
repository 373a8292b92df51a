"""Batches of cases on a Ray cluster; a worker or a node that dies loses no case, its batch runs elsewhere."""

from __future__ import annotations

import socket
import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from experiments.bench_cases import Case, Maker
from steer_env.errors import InputError
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
    ray = _ray()
    from experiments.bench_run import drive

    if not ray.is_initialized():
        try:
            _answers(address)
            ray.init(address=address, log_to_driver=False, configure_logging=False)
        except (OSError, RuntimeError, ValueError) as wrong:
            problem = f"no Ray cluster answers at {address!r} ({wrong})"
            raise InputError("--ray", problem, "start one: ray start --head") from wrong
    for make in makers.values():
        module = sys.modules.get(getattr(make, "__module__", ""))
        if module is not None and module.__name__.startswith("own_controller_"):
            ray.cloudpickle.register_pickle_by_value(module)
    # A batch is a pure function of its arguments: Ray may run it again as often as nodes die.
    remote = ray.remote(num_cpus=1, max_retries=-1)(drive)
    shared = ray.put(reference)
    waiting = {remote.remote(batch, shared, seed, makers.get(batch[0].controller)): batch for batch in batches}
    while waiting:
        for done in ray.wait(list(waiting), num_returns=1)[0]:
            results = ray.get(done)
            yield waiting.pop(done), results


def _answers(address: str) -> None:
    """Raise OSError where nothing listens at HOST:PORT: Ray itself would go on trying for minutes."""
    host, _, port = address.rpartition(":")
    if host and port.isdigit() and "://" not in address:
        socket.create_connection((host, int(port)), timeout=5.0).close()


def _ray() -> Any:
    try:
        import ray
    except ImportError as missing:
        raise InputError("--ray", "Ray is not installed", 'pip install "steer-env[learn]"') from missing
    return ray
