"""A lower layer never imports a higher one, and only few files may know Numba's and LLVM's insides."""

import ast
import importlib.util
from pathlib import Path

import pytest

import lumipath

ROOT = Path(lumipath.__path__[0])

# From the lowest to the highest; modules of one row may import each other.
LAYERS = (
    ("errors",),
    ("settings", "scene", "lang"),
    ("formats", "scenes", "pack.layout"),
    ("kernels",),
    ("accel",),
    ("pack",),
    ("devices",),
    ("rendering",),
    ("imaging",),
    ("bench",),
    ("cli",),
    ("__main__",),
)
LEVELS = {part: level for level, row in enumerate(LAYERS) for part in row}

# Rows say who may import whom; these are narrower than the rows.
ONLY = {
    "errors": set(),
    "settings": {"errors"},
    "scene": {"errors", "scene"},
    "lang": {"errors", "lang"},
    "pack.layout": {"lang"},
    "formats": {"errors", "scene", "formats"},
    # A cubemap becomes an environment in `formats`.
    "scenes": {"errors", "scene", "scenes", "formats"},
}

COMPILER = ("numba.core", "numba.extending", "llvmlite")


def module_name(file):
    parts = file.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_name(file): file for file in sorted(ROOT.rglob("*.py"))}


def part_of(module):
    """The entry of LAYERS that a module of lumipath belongs to."""
    return next(name for name in (module, module.split(".")[0]) if name in LEVELS)


def imports_of(module):
    """Absolute names of all that a module imports, within functions and for type checking too, with their lines."""
    file = MODULES[module]
    package = f"lumipath.{module}" if file.name == "__init__.py" else f"lumipath.{module}".rpartition(".")[0]
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = "." * node.level + (node.module or "")
            base = importlib.util.resolve_name(base, package.rstrip(".")) if node.level else base
            for alias in node.names:
                name = f"{base}.{alias.name}"
                is_module = name.removeprefix("lumipath.") in MODULES
                yield (name if is_module or base in ("lumipath", "numba", "llvmlite") else base), node.lineno


def inner_imports(module):
    """Modules of lumipath that a module imports, with their lines."""
    for name, line in imports_of(module):
        # What the package itself defines, its version, is no module.
        if name.startswith("lumipath.") and name != "lumipath.__version__":
            yield name.removeprefix("lumipath."), line


@pytest.mark.parametrize("module", [name for name in MODULES if name])
def test_imports_point_downwards(module):
    part = part_of(module)
    for imported, line in inner_imports(module):
        other = part_of(imported)
        place = f"{MODULES[module]}:{line} imports {imported}"
        assert LEVELS[other] <= LEVELS[part], f"{place}, which is a higher layer than {part}"
        assert other in ONLY.get(part, {other}), f"{place}, but {part} may use only {sorted(ONLY[part])}"


def test_the_package_itself_imports_nothing_of_its_own():
    assert list(inner_imports("")) == []


@pytest.mark.parametrize("module", [name for name in MODULES if name and part_of(name) != "lang"])
def test_only_lang_knows_the_compiler(module):
    for name, line in imports_of(module):
        if any(name == part or name.startswith(f"{part}.") for part in COMPILER):
            pytest.fail(f"{MODULES[module]}:{line} imports {name}; only lumipath.lang may")


def test_this_test_sees_imports():
    assert "accel.trace8" in [name for name, _ in inner_imports("accel.packets")]
    assert "rendering.session" in [name for name, _ in inner_imports("cli.render")]
    assert any(name.startswith("numba.core") for name, _ in imports_of("lang.kernel"))
    assert "llvmlite.binding" in [name for name, _ in imports_of("lang.host")]
