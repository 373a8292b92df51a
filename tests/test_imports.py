"""Who may import whom: the directions that keep an equation usable from everywhere."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("steer_env", "controllers", "identification", "experiments")

# Room -> what it may import of ours, besides itself. A room is the longest prefix listed here.
BASICS = {"steer_env.errors", "steer_env.atomic"}
ALLOWED = {
    "steer_env": set(),
    "steer_env.errors": set(),
    "steer_env.atomic": set(),
    "steer_env.units": BASICS,
    "steer_env.campaign_file": BASICS,
    "steer_env.campaign_mf4": BASICS | {"steer_env.campaign_file"},
    "steer_env.interface": BASICS | {"steer_env.units", "steer_env.physics"},
    "steer_env.physics": BASICS | {"steer_env.units"},
    "steer_env.plants": BASICS | {"steer_env.units", "steer_env.physics"},
    "steer_env.manoeuvres": BASICS | {"steer_env.units", "steer_env.physics"},
    # The stand-in for a real car: nothing that describes the reference or identifies it.
    "steer_env.testcar": BASICS
    | {"steer_env", "steer_env.units", "steer_env.physics", "steer_env.manoeuvres"},
    "steer_env.envs": BASICS
    | {
        "steer_env.campaign_file",
        "steer_env.units",
        "steer_env.interface",
        "steer_env.physics",
        "steer_env.plants",
        "steer_env.manoeuvres",
    },
    "steer_env.rig": BASICS
    | {
        "steer_env.campaign_file",
        "steer_env.campaign_mf4",
        "steer_env.units",
        "steer_env.interface",
        "steer_env.physics",
        "steer_env.plants",
    },
    # The environment on a motor is the environment: it shares the task, the layout, the control unit and the reward
    # of those in simulation. The rest of the rig (codec, safety, watchdog, virtual motor) knows none of them.
    **{
        f"steer_env.rig.{name}": BASICS
        | {
            "steer_env.units",
            "steer_env.interface",
            "steer_env.physics",
            "steer_env.plants",
            "steer_env.manoeuvres",
            "steer_env.envs",
            "steer_env.rig",
            "steer_env.rig.connection",
        }
        for name in ("rig_env", "connection")
    },
    "controllers": BASICS
    | {"steer_env.units", "steer_env.interface", "steer_env.physics", "steer_env.plants"},
    "identification": BASICS
    | {"steer_env", "steer_env.campaign_file", "steer_env.units", "steer_env.physics", "steer_env.plants"},
}
# What is identified from the test car may not be built into it.
NOT_EVEN = {"steer_env.testcar": {"steer_env.physics.reference", "steer_env.physics.assist"}}
LEAF = "experiments"  # may import everything; nobody imports it
# Which rooms alone may import a third-party package, so that the others run without it.
ONLY_IN = {
    "can": ("steer_env.rig",),
    "asammdf": ("steer_env.campaign_mf4", "steer_env.rig", "identification"),
    "cantools": ("steer_env.rig",),
    "canopen": ("steer_env.rig",),
    "torch": ("experiments",),
    "stable_baselines3": ("experiments",),
    "ray": ("experiments",),
    "plotly": ("experiments",),
    "matplotlib": ("steer_env.envs", "experiments"),
    "gymnasium": ("steer_env", "steer_env.envs", "steer_env.rig", "steer_env.rig.rig_env", "experiments"),
}


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(path): path for package in PACKAGES for path in (ROOT / package).rglob("*.py")}


def imports_of(module: str) -> Iterator[str]:
    """Full names of what a module imports, at its top or inside a function."""
    path = MODULES[module]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:  # from . import x: an __init__ is its own package, a file is not
                package = module.split(".")
                package = package[: len(package) - node.level + (path.name == "__init__.py")]
                base = ".".join([*package, *filter(None, [node.module])])
            for alias in node.names:
                full = f"{base}.{alias.name}"
                yield full if full in MODULES else base


def room_of(module: str) -> str:
    rooms = [room for room in ALLOWED if module == room or module.startswith(f"{room}.")]
    return max(rooms, key=len, default=module.split(".")[0])


@pytest.mark.parametrize("module", sorted(MODULES))
def test_imports_go_in_the_agreed_direction(module):
    """Catches physics that knows an environment, a controller that peeks at one, and the like."""
    room = room_of(module)
    for imported in imports_of(module):
        package = imported.split(".")[0]
        assert package != "tests", f"{module} imports {imported}"
        if package in PACKAGES and room != LEAF:
            assert room in ALLOWED, f"{module} is in no listed room"
            there = room_of(imported)
            assert there in ALLOWED[room] | {room}, f"{module} must not import {imported}"
            assert imported not in NOT_EVEN.get(room, ()), f"{module} must not import {imported}"
        rooms = ONLY_IN.get(package)
        assert rooms is None or room in rooms, f"{module} must not import {imported}"


def test_the_rules_see_every_form_of_import(tmp_path, monkeypatch):
    """The reader of imports must itself find what it looks for."""
    path = tmp_path / "assumed.py"
    path.write_text(
        "import torch.nn\nfrom .envs import task\nfrom . import units\n"
        "def f():\n    from steer_env import errors\n"
    )
    monkeypatch.setitem(MODULES, "steer_env.assumed", path)
    found = set(imports_of("steer_env.assumed"))
    assert {"torch.nn", "steer_env.units", "steer_env.errors"} <= found
    assert any(name.startswith("steer_env.envs") for name in found)
    assert room_of("steer_env.physics.vehicle") == "steer_env.physics"
    assert room_of("experiments.report.page") == LEAF


def test_importing_the_package_loads_nothing_heavy():
    """Catches an import at the top of a file that makes every start of the program slow."""
    code = "import sys, steer_env; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert "steer_env" in loaded
    assert not loaded & {"torch", "plotly", "matplotlib", "can", "numba", "scipy", "pandas", "ray"}


def test_the_help_of_the_program_loads_nothing_heavy():
    code = (
        "import sys\nfrom experiments.cli import main\n"
        "main(['--help'], standalone_mode=False)\nprint('|', *sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split("|")[-1].split())
    assert "click" in loaded
    assert not loaded & {"torch", "plotly", "matplotlib", "can", "numba", "scipy", "pandas", "ray"}


def test_importing_the_environments_loads_no_compiler():
    """Catches numba at the top of a file of physics: it takes longer to load than all the rest."""
    code = "import sys, steer_env.envs; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert "steer_env.envs.lanes" in loaded
    assert not loaded & {"torch", "plotly", "matplotlib", "can", "numba", "llvmlite", "scipy", "pandas", "ray"}
