"""What `import lumipath` offers, and what it costs."""

import importlib
import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import lumipath

PUBLIC = [
    "AmbientLight",
    "Box",
    "Camera",
    "Checker",
    "Checkpoint",
    "CheckpointError",
    "Comparison",
    "Conductor",
    "Cone",
    "Cylinder",
    "DeviceError",
    "Dielectric",
    "Diffuse",
    "DirectionalLight",
    "Environment",
    "Group",
    "Image",
    "ImageError",
    "Instance",
    "LumipathError",
    "LumipathWarning",
    "Material",
    "Mesh",
    "Mix",
    "PointLight",
    "Principled",
    "Progress",
    "RenderError",
    "RenderSettings",
    "Scene",
    "SceneError",
    "Session",
    "Sky",
    "Sphere",
    "SpotLight",
    "Square",
    "Texture",
    "ThinDielectric",
    "UsageError",
    "__version__",
    "builtin",
    "compare",
    "denoise",
    "false_colour",
    "list_devices",
    "load",
    "merge",
    "read_texture",
    "render",
]


SOURCES = str(Path(lumipath.__path__[0]).parent)


def run_python(code):
    """What `code` prints in a new process."""
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {SOURCES!r}); {code}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.stderr == ""
    return done.stdout


def test_all_is_exact():
    assert lumipath.__all__ == PUBLIC
    assert dir(lumipath) == PUBLIC


@pytest.mark.parametrize("name", PUBLIC)
def test_every_name_is_there_and_explained(name):
    value = getattr(importlib.import_module(lumipath._HOME_OF[name]), name) if name in lumipath._HOME_OF else "0.1.0"
    assert name == "__version__" or (value.__name__ == name and inspect.getdoc(value))


@pytest.mark.parametrize("first", ["render", "load", "Session", "Image"])
def test_render_is_the_function_whatever_was_used_before(first):
    done = run_python(f"import lumipath as lp; lp.{first}; print(type(lp.render).__name__)")
    assert done == "function\n"


def test_star_import():
    namespace = {}
    exec("from lumipath import *", namespace)
    assert set(PUBLIC) <= set(namespace)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="'lumipath' has no attribute 'Renderer'"):
        lumipath.Renderer  # noqa: B018


@pytest.mark.parametrize("package", ["lang", "scene", "scenes", "formats.ray", "accel.build"])
def test_inner_packages_export_what_they_say(package):
    module = importlib.import_module(f"lumipath.{package}")
    assert len(set(module.__all__)) == len(module.__all__)
    for name in module.__all__:
        assert hasattr(module, name), name


def test_every_error_is_a_lumipath_error():
    for name in PUBLIC:
        if name.endswith("Error"):
            assert issubclass(getattr(lumipath, name), lumipath.LumipathError)


@pytest.mark.parametrize(
    ("statement", "heavy"),
    [
        ("import lumipath", ("numba", "numpy", "OpenImageIO", "lark", "typer", "rich", "attrs")),
        ("import lumipath; lumipath.RenderSettings()", ("numba", "numpy", "OpenImageIO", "lark")),
        ("import lumipath; lumipath.builtin('cornell-box')", ("numba", "OpenImageIO", "lark")),
    ],
)
def test_importing_is_light(statement, heavy):
    assert run_python(f"import sys; {statement}; print(*[name for name in {heavy} if name in sys.modules])") == "\n"
