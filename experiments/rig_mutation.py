"""Do the safety tests notice when the safety layer is wrong? One small fault at a time is put into its source.

    python -m experiments.rig_mutation [--jobs 2] [--only WORD]

Every mutant (a comparison, constant, sign, operator, negation, min/max or statement changed) runs the safety tests in a
forked process until the first test fails. What no test notices is printed: it needs a test, or a row in
docs/rig_safety.md that says why it changes nothing. After opendbc's safety/tests/mutation.py.
"""

from __future__ import annotations

import ast
import importlib
import os
import signal
import sys
import time
import types
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import click

from experiments.cli_options import print_table

ROOT = Path(__file__).resolve().parents[1]
MODULES = ("steer_env.rig.safety_limits", "steer_env.rig.safety_faults", "steer_env.rig.safety")
TESTS = ("boundaries", "energy", "limits", "faults", "arming", "any_sequence")
TIMEOUT = 90.0  # s; a mutant that hangs counts as noticed

_COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
}
_ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.Mod: ast.Mult,
}
_NAMES = {"min": "max", "max": "min", "any": "all", "all": "any"}


class Mutant(NamedTuple):
    """One changed place of a module's source."""

    module: str
    line: int
    change: str
    source: str


def mutants_of(module: str) -> Iterator[Mutant]:
    """Every mutant of a module, in the order of its source."""
    text = _path(module).read_text(encoding="utf-8")
    n_nodes, seen = sum(1 for _ in ast.walk(ast.parse(text))), {ast.unparse(ast.parse(text))}
    for k in range(n_nodes):
        variant = 0
        while True:
            tree = ast.parse(text)
            node = list(ast.walk(tree))[k]
            if id(node) in _not_code(tree) or not (change := _change(node, variant)):
                break
            source = ast.unparse(ast.fix_missing_locations(tree))
            if source not in seen:  # a negated test and a dropped "not" may come to the same
                seen.add(source)
                yield Mutant(module, getattr(node, "lineno", 0), change, source)
            variant += 1


def _not_code(tree: ast.Module) -> set[int]:
    """Nodes that no run of the module depends on: annotations with their ranges, docstrings, imports."""
    dead: set[int] = set()
    for node in ast.walk(tree):
        outside: list[ast.AST | None] = []
        if isinstance(node, ast.AnnAssign):
            outside.append(node.annotation)
        elif isinstance(node, ast.FunctionDef):
            outside += [node.returns, *(argument.annotation for argument in node.args.args)]
        elif isinstance(node, ast.Import | ast.ImportFrom) or _is_docstring(node):
            outside.append(node)
        dead |= {id(part) for top in outside if top is not None for part in ast.walk(top)}
    return dead


def _is_docstring(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _change(node: ast.AST, variant: int) -> str:
    """Change a node in place in the ``variant``-th of its ways; what was done, or "" if there is no such way."""
    before = ast.unparse(node) if isinstance(node, ast.expr | ast.stmt) else ""
    if isinstance(node, ast.Compare):
        kinds = _COMPARISONS.get(type(node.ops[0]), ())
        if variant < len(kinds):
            node.ops[0] = kinds[variant]()
            return f"{before} -> {ast.unparse(node)}"
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        value = node.value
        news: tuple[float, ...] = (not value,) if isinstance(value, bool) else (value + 1, value * 0.9 or -1e-3)
        if variant < len(news):
            node.value = news[variant]
            return f"{before} -> {news[variant]}"
    elif isinstance(node, ast.BinOp | ast.AugAssign) and variant == 0 and type(node.op) in _ARITHMETIC:
        node.op = _ARITHMETIC[type(node.op)]()
        return f"{before} -> {ast.unparse(node)}"
    elif isinstance(node, ast.BoolOp) and variant == 0:
        node.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        return f"{before} -> {ast.unparse(node)}"
    elif isinstance(node, ast.UnaryOp) and variant == 0 and isinstance(node.op, ast.Not | ast.USub):
        node.op = ast.UAdd() if isinstance(node.op, ast.USub) else ast.Not()
        if isinstance(node.op, ast.Not):
            node.operand = ast.UnaryOp(ast.Not(), node.operand)
        return f"{before} -> {ast.unparse(node)}"
    elif isinstance(node, ast.Name) and variant == 0 and node.id in _NAMES:
        node.id = _NAMES[node.id]
        return f"{before} -> {node.id}"
    elif isinstance(node, ast.Call) and variant == 0 and ast.unparse(node.func) == "abs":
        node.func = ast.Name("float", ast.Load())
        return f"{before} -> without abs"
    elif isinstance(node, ast.If | ast.While | ast.IfExp) and variant == 0:
        node.test = ast.UnaryOp(ast.Not(), node.test)
        return f"if {ast.unparse(node.test)}"
    elif isinstance(node, ast.FunctionDef):
        return _without(node, variant)
    return ""


def _without(node: ast.FunctionDef, variant: int) -> str:
    """Take the ``variant``-th simple statement out of a function, nested blocks included."""
    places = [
        (block, i)
        for part in ast.walk(node)
        for block in (getattr(part, "body", None), getattr(part, "orelse", None))
        if isinstance(block, list)
        for i, line in enumerate(block)
        if isinstance(line, ast.Assign | ast.AugAssign | ast.Expr | ast.Raise | ast.Return) and not _is_docstring(line)
    ]
    if variant >= len(places):
        return ""
    block, i = places[variant]
    gone, block[i] = block[i], ast.Pass()
    return f"line {gone.lineno} removed: {ast.unparse(gone)}"


def notices(mutant: Mutant) -> int:
    """Fork a process that runs the safety tests against a mutant; its process id. It exits with 1 if one failed."""
    child = os.fork()
    if child:
        return child
    try:
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        import pytest

        for name in MODULES:
            source = mutant.source if name == mutant.module else _path(name).read_text(encoding="utf-8")
            module = types.ModuleType(name)
            module.__file__ = str(_path(name))
            sys.modules[name] = module
            setattr(importlib.import_module("steer_env.rig"), name.rsplit(".", 1)[1], module)
            exec(compile(source, str(_path(name)), "exec"), module.__dict__)
        paths = [str(ROOT / "tests" / "rig" / f"test_safety_{test}.py") for test in TESTS]
        options = ["-x", "-q", "-p", "no:cacheprovider", "-W", "ignore:Module already imported"]
        os._exit(0 if pytest.main([*paths, *options]) == 0 else 1)
    finally:
        os._exit(1)  # a mutant that cannot even be imported is noticed


def survivors(mutants: list[Mutant], jobs: int) -> Iterator[tuple[int, Mutant | None]]:
    """Run all mutants; after each (how many are done, the mutant if no test noticed it)."""
    waiting, running, done = list(reversed(mutants)), dict[int, tuple[Mutant, float]](), 0
    while waiting or running:
        while waiting and len(running) < jobs:
            mutant = waiting.pop()
            running[notices(mutant)] = (mutant, time.monotonic())
        for child, (mutant, since) in list(running.items()):
            ended, status = os.waitpid(child, os.WNOHANG)
            if not ended and time.monotonic() - since > TIMEOUT:
                os.kill(child, signal.SIGKILL)
                ended, status = os.waitpid(child, 0)
            if ended:
                del running[child]
                done += 1
                yield done, mutant if status == 0 else None
        time.sleep(0.01)


def _path(module: str) -> Path:
    return ROOT / (module.replace(".", "/") + ".py")


@click.command()
@click.option("--jobs", default=2, show_default=True, help="Processes at a time.")
@click.option("--only", default="", help="Only mutants whose module or change holds this word.")
def main(jobs: int, only: str) -> None:
    """Print every mutant of the safety layer that no test notices."""
    importlib.import_module("pytest")
    importlib.import_module("hypothesis.stateful")
    mutants = [mutant for module in MODULES for mutant in mutants_of(module)]
    mutants = [mutant for mutant in mutants if only in f"{mutant.module} {mutant.change}"]
    unchanged = Mutant(MODULES[-1], 0, "nothing", _path(MODULES[-1]).read_text(encoding="utf-8"))
    if next(survivors([unchanged], 1))[1] is None:
        raise click.ClickException("the safety tests fail on the unchanged source: mend that first")
    alive = []
    for done, survivor in survivors(mutants, jobs):
        if survivor:
            alive.append(survivor)
            click.echo(f"not noticed: {survivor.module} line {survivor.line}: {survivor.change}", err=True)
        if done % 25 == 0:
            click.echo(f"{done} of {len(mutants)} run, {len(alive)} not noticed", err=True)
    print_table(["module", "line", "change"], [[m.module, m.line, m.change] for m in alive])
    click.echo(f"{len(mutants)} mutants, {len(alive)} not noticed by any test")


if __name__ == "__main__":
    main()
