"""Conventions that a reader relies on, checked on the source itself."""

import ast
import importlib
from pathlib import Path

import pytest

from steer_env.units import quantities

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("steer_env", "controllers", "identification", "experiments")
MOST_LINES = 300


def sources(*folders: str) -> list[str]:
    """Paths relative to the root, as test ids."""
    return [
        path.relative_to(ROOT).as_posix()
        for folder in folders
        for path in sorted((ROOT / folder).rglob("*.py"))
    ]


def tree_of(path: str) -> ast.Module:
    return ast.parse((ROOT / path).read_text(encoding="utf-8"))


PHYSICS = sources("steer_env/physics")


@pytest.mark.parametrize("path", sources(*PACKAGES, "tests"))
def test_files_stay_readable(path):
    """Catches the file that everything ends up in, under that name or by its size."""
    lines = (ROOT / path).read_text(encoding="utf-8").count("\n")
    assert lines <= MOST_LINES, f"{lines} lines"
    names = {"utils", "util", "helpers", "misc", "common"}
    assert Path(path).stem not in names
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import | ast.ImportFrom):
            imported = [alias.name for alias in node.names] + [getattr(node, "module", "") or ""]
            ours = [name for name in imported if name.split(".")[0] in (*PACKAGES, *names)]
            assert not any(set(name.split(".")) & names for name in ours)


@pytest.mark.parametrize("path", sources(*PACKAGES))
def test_no_error_is_swallowed(path):
    """A bare except, or one that only passes, hides a fault from everybody."""
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.ExceptHandler):
            assert node.type is not None, f"line {node.lineno}: bare except"
            broad = isinstance(node.type, ast.Name) and node.type.id in (
                "Exception",
                "BaseException",
            )
            silent = all(isinstance(line, ast.Pass | ast.Continue) for line in node.body)
            assert not (broad and silent), f"line {node.lineno}: swallows every error"


@pytest.mark.parametrize("path", PHYSICS)
def test_public_equations_say_what_they_are(path):
    """A docstring holds unit and equation number; without it nobody can check the formula."""
    for node in tree_of(path).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            assert ast.get_docstring(node), f"{node.name} (line {node.lineno})"


@pytest.mark.parametrize("path", PHYSICS)
def test_equations_use_products_not_powers(path):
    """x**2 differs from x*x by one bit between Python and compiled code on some inputs."""
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            exponent = node.right.value if isinstance(node.right, ast.Constant) else None
            whole = isinstance(exponent, int) or (
                isinstance(exponent, float) and exponent.is_integer()
            )
            assert not whole, f"line {node.lineno}: write the product"


def parameter_sets() -> list[type]:
    """The NamedTuples of the physics modules in which some field has a number as its default."""
    found = {}
    for path in PHYSICS:
        module = importlib.import_module(path.removesuffix(".py").replace("/", "."))
        for value in vars(module).values():
            if isinstance(value, type) and issubclass(value, tuple) and numbers_of(value):
                found[f"{value.__module__}.{value.__qualname__}"] = value
    return [found[name] for name in sorted(found)]


def numbers_of(parameter_set: type) -> dict[str, float]:
    """Fields with a number as default: nested sets are listed themselves, tables are no numbers."""
    defaults = getattr(parameter_set, "_field_defaults", {})
    return {name: value for name, value in defaults.items() if isinstance(value, int | float)}


@pytest.mark.parametrize("parameter_set", parameter_sets(), ids=lambda value: value.__name__)
def test_every_parameter_has_unit_range_and_source(parameter_set):
    """Catches the bare number: no unit, no range, nobody knows where it came from."""
    described = quantities(parameter_set)
    for name, default in numbers_of(parameter_set).items():
        assert name in described, f"{parameter_set.__name__}.{name} has no Quantity"
        quantity = described[name]
        assert all((quantity.unit, quantity.meaning, quantity.source)), name
        assert quantity.low <= default <= quantity.high, f"{name} = {default} is out of its range"


@pytest.mark.parametrize("package", [name for name in PACKAGES if (ROOT / name).is_dir()])
def test_every_folder_with_code_is_a_package(package):
    """A folder without __init__.py works in a checkout and is missing from the wheel."""
    folders = {path.parent for path in (ROOT / package).rglob("*.py")}
    assert not [folder for folder in sorted(folders) if not (folder / "__init__.py").exists()]
