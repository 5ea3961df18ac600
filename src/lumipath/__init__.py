"""lumipath: a physically based path tracer, written wholly in Python.

    import lumipath as lp

    scene = lp.load("scene.ray")
    image = lp.render(scene, spp=256)
    image.save("scene.png")

Names are imported when they are first used, so that `import lumipath` is quick.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_HOMES = {
    "lumipath.errors": (
        "CheckpointError",
        "DeviceError",
        "ImageError",
        "LumipathError",
        "LumipathWarning",
        "RenderError",
        "SceneError",
        "UsageError",
    ),
    "lumipath.formats": ("load",),
    "lumipath.formats.images": ("read_texture",),
    "lumipath.imaging.comparison": ("Comparison", "compare"),
    "lumipath.imaging.denoising": ("denoise",),
    "lumipath.imaging.falsecolour": ("false_colour",),
    "lumipath.rendering.checkpoint": ("Checkpoint",),
    "lumipath.rendering.image": ("Image",),
    "lumipath.rendering.merging": ("merge",),
    "lumipath.rendering.progress": ("Progress",),
    "lumipath.rendering.session": ("Session", "render"),
    "lumipath.devices": ("list_devices",),
    "lumipath.scene": (
        "AmbientLight",
        "Box",
        "Camera",
        "Checker",
        "Conductor",
        "Cone",
        "Cylinder",
        "Dielectric",
        "Diffuse",
        "DirectionalLight",
        "Environment",
        "Group",
        "Instance",
        "Material",
        "Mesh",
        "Mix",
        "PointLight",
        "Principled",
        "Scene",
        "Sky",
        "Sphere",
        "SpotLight",
        "Square",
        "Texture",
        "ThinDielectric",
    ),
    "lumipath.scenes": ("builtin",),
    "lumipath.settings": ("RenderSettings",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = sorted([*_HOME_OF, "__version__"])


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'lumipath' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
