"""Run by test_bench_ray: cases over a local cluster of two nodes, one of which is killed midway."""

import json
import sys

from experiments.bench_protocol import Protocol
from experiments.bench_run import run_cases
from steer_env.plants import Reference

KILL_AFTER = 3  # cases


def main() -> None:
    import ray
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    second = cluster.add_node(num_cpus=1)
    ray.init(address=cluster.address, log_to_driver=False)
    reference = Reference.load("published")
    cases = [
        case
        for case in Protocol.load().test_cases("pid")
        if (case.plant, case.arm, case.draw, case.manoeuvre) == ("SbW", "relaxed", 0, "step_steer")
    ]
    local = run_cases(cases, reference, jobs=1)
    told = {"nodes": len(ray.nodes()), "cases": len(cases), "done_at_loss": 0}
    done = []

    def advance(steps=1, note=""):
        done.append(steps)
        if sum(done) >= KILL_AFTER and not told["done_at_loss"]:
            told["done_at_loss"] = sum(done)
            cluster.remove_node(second, allow_graceful=False)

    far = run_cases(cases, reference, advance=advance, ray=cluster.address)
    told |= {"same": far == local, "done": sum(done)}
    ray.shutdown()
    cluster.shutdown()
    print("TOLD " + json.dumps(told))


if __name__ == "__main__":
    sys.exit(main())
