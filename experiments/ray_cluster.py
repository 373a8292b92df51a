"""Functions on a Ray cluster that runs already; a worker or a node that dies loses nothing, its job runs elsewhere."""

from __future__ import annotations

import socket
from collections.abc import Callable, Iterator, Mapping
from typing import Any, TypeVar

from steer_env.errors import InputError

Key = TypeVar("Key")
Result = TypeVar("Result")


def results_of(
    function: Callable[..., Result], jobs: Mapping[Key, tuple[Any, ...]], address: str
) -> Iterator[tuple[Key, Result]]:
    """(Key, function(*arguments)) as they are finished; one CPU for each; ``address`` as ray.init takes it.

    The function gives the same for the same arguments: Ray runs a job again as often as nodes die. Every node needs
    this package. InputError where Ray is missing or does not answer, and whatever the function raises.
    """
    ray = connected(address)
    remote = ray.remote(num_cpus=1, max_retries=-1)(function)
    waiting = {remote.remote(*arguments): key for key, arguments in jobs.items()}
    while waiting:
        for done in ray.wait(list(waiting), num_returns=1)[0]:
            yield waiting.pop(done), ray.get(done)


def connected(address: str) -> Any:
    """The module ``ray``, connected to the cluster at an address; InputError where it is missing or silent."""
    try:
        import ray
    except ImportError as missing:
        raise InputError("--ray", "Ray is not installed", 'pip install "steer-env[learn]"') from missing
    if not ray.is_initialized():
        try:
            _answers(address)
            ray.init(address=address, log_to_driver=False, configure_logging=False)
        except (OSError, RuntimeError, ValueError) as wrong:
            problem = f"no Ray cluster answers at {address!r} ({wrong})"
            raise InputError("--ray", problem, "start one: ray start --head") from wrong
    return ray


def _answers(address: str) -> None:
    """Raise OSError where nothing listens at HOST:PORT: Ray itself would go on trying for minutes."""
    host, _, port = address.rpartition(":")
    if host and port.isdigit() and "://" not in address:
        socket.create_connection((host, int(port)), timeout=5.0).close()
