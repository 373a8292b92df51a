"""Drive many cases: on the cores of this machine, or on a Ray cluster; what is finished stays finished.

A batch holds the cases of one controller at one plant, causality and speed. Every result follows
from its case, the reference and the seed alone, so neither the order nor the place changes a bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import partial
from pathlib import Path
from typing import Any

import controllers
from experiments.bench_cases import Case, Maker, result_of
from experiments.bench_protocol import Protocol
from experiments.bench_store import Store
from steer_env.interface import Controller
from steer_env.plants import Plant, Reference

Result = dict[str, Any]
Batch = tuple[Case, ...]
Advance = Callable[..., None]


def run_cases(
    cases: Sequence[Case],
    reference: Reference,
    seed: int = 0,
    jobs: int = 1,
    store: Path | None = None,
    advance: Advance = lambda *_, **__: None,
    makers: Mapping[str, Maker] | None = None,
    ray: str | None = None,
) -> list[Result]:
    """Results in the order of the cases: case, stable, scores by metric name, plot data.

    ``makers`` stand in for controllers by name. ``store`` keeps finished batches and takes what is
    there already (never for ``makers``, whose content has no key). ``ray`` is the address of a Ray
    cluster ("auto": the one that runs here).
    """
    chosen = makers or {}
    kept = None if store is None else Store(store, reference, seed)
    found: dict[Case, Result] = {}
    waiting: list[Batch] = []
    for batch in batches_of(cases):
        done = kept.read(batch) if kept and batch[0].controller not in chosen else None
        if done is None:
            waiting.append(batch)
            continue
        found.update(zip(batch, done, strict=True))
        advance(len(batch), note=f"{batch[0].controller} kept")
    for batch, results in _driven(waiting, reference, seed, jobs, chosen, ray, advance):
        found.update(zip(batch, results, strict=True))
        if kept and batch[0].controller not in chosen:
            kept.write(batch, results)
    return [found[case] for case in cases]


def batches_of(cases: Sequence[Case]) -> list[Batch]:
    """Cases in batches, in order of appearance."""
    batches: dict[tuple[Any, ...], list[Case]] = {}
    for case in cases:
        key = (case.controller, case.plant, case.causality, case.speed_kmh, case.split, case.linear)
        batches.setdefault(key, []).append(case)
    return [tuple(batch) for batch in batches.values()]


def drive(
    batch: Batch, reference: Reference, seed: int, make: Maker | None, advance: Advance = lambda *_, **__: None
) -> list[Result]:
    """Results of one batch; a controller is designed once and reset for every case."""
    seeds = Protocol.load().draw_seeds
    made: dict[bool, Controller] = {}
    results = []
    for case in batch:

        def once(plant: Plant, felt: Reference, causality: str, case: Case = case) -> Controller:
            if case.prompt not in made:
                fresh = make or partial(controllers.make, case.controller)
                made[case.prompt] = fresh(plant, felt, causality)
            return made[case.prompt]

        results.append(result_of(case, reference, seed, seeds.get(case.split, ()), once))
        advance(note=case.name)
    return results


def _driven(
    batches: Sequence[Batch],
    reference: Reference,
    seed: int,
    jobs: int,
    makers: Mapping[str, Maker],
    ray: str | None,
    advance: Advance,
) -> Iterator[tuple[Batch, list[Result]]]:
    """(Batch, its results) as they are finished."""
    if ray is not None:
        from experiments.bench_ray import driven_on_cluster  # Ray loads when it is asked for

        for batch, results in driven_on_cluster(batches, reference, seed, makers, ray):
            advance(len(batch), note=batch[0].name)
            yield batch, results
        return
    # Compiled episodes run outside Python's lock, so threads share one compilation.
    pool = ThreadPoolExecutor(jobs)
    try:
        waiting = {
            pool.submit(drive, batch, reference, seed, makers.get(batch[0].controller), advance): batch
            for batch in batches
        }
        for done in as_completed(waiting):
            yield waiting[done], done.result()
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
