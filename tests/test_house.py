"""Rules of the house that no tool checks."""

import importlib
import inspect
import pkgutil
from pathlib import Path

import pytest

import surefix

ROOT = Path(surefix.__file__).parent
MODULES = sorted(
    ["surefix", *(found.name for found in pkgutil.walk_packages([str(ROOT)], "surefix."))]
)
SOURCES = sorted([*ROOT.rglob("*.py"), *Path(__file__).parent.rglob("*.py")])
VAGUE = {"utils", "util", "helpers", "common", "misc", "manager", "managers"}


@pytest.mark.parametrize("name", MODULES)
def test_public_names_are_declared_sorted_and_real(name):
    module = importlib.import_module(name)
    public = getattr(module, "__all__", None)
    if public is None:
        assert not own(module), f"{name} defines public names but has no __all__"
        return
    assert list(public) == sorted(public, key=by_kind)
    missing = [each for each in public if not hasattr(module, each)]
    assert not missing, f"{name}.__all__ names what does not exist: {missing}"
    hidden = [each for each in own(module) if each not in public]
    assert not hidden, f"{name} defines public names that __all__ leaves out: {hidden}"


@pytest.mark.parametrize("name", MODULES)
def test_public_names_are_documented(name):
    module = importlib.import_module(name)
    assert module.__doc__, f"{name} has no docstring"
    bare = [each for each, thing in own(module).items() if not inspect.getdoc(thing)]
    assert not bare, f"{name}: no docstring on {bare}"


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.name)
def test_files_are_small_and_named_after_a_concept(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 400
    assert not VAGUE & set(path.stem.split("_"))


def own(module):
    """Functions and classes that the module itself defines under a public name."""
    return {
        name: thing
        for name, thing in vars(module).items()
        if not name.startswith("_")
        and callable(thing)
        and not isinstance(thing, type(pytest))
        and getattr(thing, "__module__", None) == module.__name__
        and hasattr(thing, "__name__")
    }


def by_kind(name):
    """Order of ruff's RUF022: constants, then classes, then the rest."""
    return (0 if name.isupper() and len(name) > 1 else 1 if name[:1].isupper() else 2, name)
