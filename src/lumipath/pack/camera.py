"""A camera and the settings that replace parts of it, as kernels see them."""

from __future__ import annotations

import math

import attrs
import numpy as np
from numpy.typing import NDArray

from ..scene import Camera, Scene
from ..settings import RenderSettings
from . import layout
from .filters import filter_numbers

_OVERRIDES = ("projection", "aperture", "focus", "blades", "blade_rotation")

_SAMPLERS = {"sobol": 0, "blue-noise": layout.BLUE_NOISE, "independent": layout.INDEPENDENT_SAMPLER}

_PROJECTIONS = {
    "perspective": 0,
    "orthographic": layout.ORTHOGRAPHIC,
    "panorama": layout.PANORAMA,
    "fisheye": layout.FISHEYE,
    "fisheye-equisolid": layout.EQUISOLID,
}


def overridden(camera: Camera, settings: RenderSettings) -> Camera:
    """The camera with those of its fields that the settings give."""
    given = {name: getattr(settings, name) for name in _OVERRIDES if getattr(settings, name) is not None}
    # Another focus does not change what an orthographic camera shows.
    return attrs.evolve(camera, height=camera.extent, **given) if given else camera


def camera_of(scene: Scene, settings: RenderSettings) -> Camera:
    """The camera that a scene is rendered with.

    Raises:
        SceneError: there is no camera of that name.
    """
    return overridden(scene.camera(settings.camera), settings)


def camera_features(settings: RenderSettings, camera: Camera, *, signed: bool) -> int:
    """Feature bits of camera rays.

    Args:
        settings: of the render.
        camera: its own fields; those that the settings give replace them.
        signed: whether samples may count negatively; else only the positive part of a filter is used.
    """
    camera = overridden(camera, settings)
    mask = _SAMPLERS[settings.sampler]
    mask |= layout.LENS if camera.aperture > 0 else 0
    mask |= layout.BLADES if camera.aperture > 0 and camera.blades > 0 else 0
    mask |= _PROJECTIONS[camera.projection]
    mask |= layout.SHIFT if any(camera.window(1, 1)[2:]) else 0
    numbers = filter_numbers(settings.filter, settings.filter_radius)
    if numbers is not None:
        mask |= layout.FILTER
        mask |= layout.SIGNED_FILTER if signed and numbers[1] else 0
    return mask


def lens_numbers(camera: Camera, settings: RenderSettings, width: int, height: int) -> NDArray[np.float32]:
    """The numbers of `View.lens` for a full image of width x height pixels; no setting replaces any of the camera's."""
    lens = np.zeros((7, 4), np.float32)
    lens[0, :3] = camera.position
    lens[1:4, :3] = camera.axes()
    lens[0, 3] = camera.aperture
    lens[1, 3] = camera.focus
    lens[3, 3], lens[2, 3], lens[5, 0], lens[5, 1] = camera.window(width, height)
    lens[4, 0] = camera.blades
    # The first corner points up, a quarter turn from the right.
    lens[4, 1] = (camera.blade_rotation / 360 + 0.25) % 1.0
    # At the edge of a fisheye's circle: the angle from the axis in turns, or the sine of half of it.
    is_equisolid = camera.projection == "fisheye-equisolid"
    lens[5, 2] = math.sin(math.radians(camera.fisheye_fov) / 4) if is_equisolid else camera.fisheye_fov / 720
    numbers = filter_numbers(settings.filter, settings.filter_radius)
    if numbers is None:
        return lens.reshape(-1)
    return np.concatenate([lens[:6].reshape(-1), numbers[0]])
