"""Run by test_training_cluster: seeds trained over a local cluster of two nodes; then one node dies at its work."""

import json
import sys
import tempfile
import time
from pathlib import Path
from threading import Thread

from click.testing import CliRunner

from experiments.cli import main as steer_env
from experiments.ray_cluster import results_of

SMALL = ("learning.environments=8", "learning.rollout=16", "learning.batch=64")


def train(out, *more):
    """What the command prints as JSON."""
    settings = [part for setting in SMALL for part in ("--set", setting)]
    # Without a base law there is no gate to pass, which takes longer than all the rest here.
    asked = ["--base", "none", "--steps", "640", "--quiet", "--json", "--out", str(out)]
    arguments = ["train", "SbW-Impedance", *asked, *settings, *more]
    done = CliRunner().invoke(steer_env, arguments, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return json.loads(done.stdout)


def leave_a_mark(k, place):
    """k, and a file that tells on which node."""
    import ray

    Path(place, f"{k}_{ray.get_runtime_context().get_node_id()}").touch()
    time.sleep(4.0)
    return k


def main() -> None:
    import ray
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    second = cluster.add_node(num_cpus=1)
    with tempfile.TemporaryDirectory() as folder:
        far = train(Path(folder) / "far", "--seeds", "0,1", "--ray", cluster.address)
        told = {"nodes": len(ray.nodes()), "far": far, "here": train(Path(folder) / "here", "--seed", "1")}
        left = [(Path(folder) / name / "policy.safetensors").read_bytes() for name in ("far/seed_1", "here")]
        told |= {"same": left[0] == left[1], "files": sorted(p.name for p in (Path(folder) / "far/seed_0").iterdir())}
        began = time.perf_counter()
        told["again"] = train(Path(folder) / "far", "--seeds", "0,1", "--ray", cluster.address)["policy, seed 1"]
        told["again_s"] = time.perf_counter() - began

    with tempfile.TemporaryDirectory() as place:

        def kill():
            while not list(Path(place).glob(f"*_{second.node_id}")):
                time.sleep(0.05)
            cluster.remove_node(second, allow_graceful=False)

        Thread(target=kill, daemon=True).start()
        found = dict(results_of(leave_a_mark, {k: (k, place) for k in range(2)}, cluster.address))
        told |= {"found": sorted(found.values()), "marks": len(list(Path(place).iterdir()))}
    ray.shutdown()
    cluster.shutdown()
    print("TOLD " + json.dumps(told))


if __name__ == "__main__":
    sys.exit(main())
