"""Finished cases on disk: one file per batch, under a key made from everything its results depend on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import Any

from controllers import policy_file
from controllers.own import file_of, is_own
from experiments.bench_cases import Case
from steer_env import atomic
from steer_env.plants import Reference

Result = dict[str, Any]
# And whatever is metrics* or measures*.
CODE = ("bench_cases", "bench_noise", "bench_plots", "bench_rig", "rig_truth", "rollout")


class Store:
    """A folder of finished batches; what is there already is not driven again."""

    def __init__(self, folder: Path, reference: Reference, seed: int) -> None:
        self.folder, self.reference, self.seed = folder, reference, seed

    def read(self, cases: Sequence[Case]) -> list[Result] | None:
        """Results of a batch, or None where it has not been finished."""
        path = self._path(cases)
        if not path.exists():
            return None
        kept: list[Result] = json.loads(path.read_text("utf-8"))
        return kept

    def write(self, cases: Sequence[Case], results: Sequence[Result]) -> None:
        """Keep a batch, whole or not at all."""
        atomic.write_text(self._path(cases), json.dumps(results, allow_nan=False, separators=(",", ":")))

    def _path(self, cases: Sequence[Case]) -> Path:
        first = cases[0]
        name = f"{first.plant}_{first.causality}_{first.speed_kmh:03.0f}_{_file_name(first.controller)}"
        return self.folder / f"{name}_{key_of(cases, self.reference, self.seed)}.json"


def key_of(cases: Sequence[Case], reference: Reference, seed: int) -> str:
    """A hash of everything results depend on: the cases, the reference, the seed, the code, the gains."""
    digest = hashlib.sha256(json.dumps([*map(asdict, cases), seed], sort_keys=True).encode())
    digest.update(reference.table.tobytes())
    digest.update(_code())
    for name in sorted({case.controller for case in cases if is_own(case.controller)}):
        digest.update(file_of(name).read_bytes())
    for name in sorted({case.controller for case in cases}):
        folder = policy_file.folder_of(name)
        if folder is not None:  # the description names the weights by their hash
            digest.update((folder / policy_file.DESCRIPTION).read_bytes())
    return digest.hexdigest()[:16]


@cache
def _code() -> bytes:
    root = Path(__file__).resolve().parents[1]
    files = [path for folder in ("steer_env", "controllers") for path in sorted((root / folder).rglob("*.py"))]
    files += sorted((root / "controllers").rglob("*.json"))
    here = root / "experiments"
    files += [here / f"{name}.py" for name in CODE]
    files += [*sorted(here.glob("metrics*.py")), *sorted(here.glob("measures*.py")), *sorted(here.glob("benchmark_v*"))]
    digest = hashlib.sha256()
    for path in [*files, root / "identification" / "frf.py"]:
        digest.update(path.read_bytes())
    return digest.digest()


def _file_name(controller: str) -> str:
    return "".join(c if c.isalnum() or c in "_-" else "-" for c in Path(controller).name)
