"""The camera."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from attrs import field, frozen

from ..errors import SceneError
from .values import float_array


def _vector(value: Any, name: str) -> tuple[float, float, float]:
    x, y, z = float_array(value, (3,), f"camera: {name}").tolist()
    return (x, y, z)


DEFAULT_FOV = math.degrees(2 * math.atan(0.5))


@frozen(kw_only=True)
class Camera:
    """A perspective camera with a thin lens.

    Args:
        position: of the lens centre, metres.
        direction: where it looks; any length but 0.
        up: roughly upwards; made orthogonal to `direction`.
        fov: vertical field of view, degrees, between 0 and 180.
        aspect: width / height of the image.
        aperture: radius of the lens, metres; 0 is a pinhole: everything is sharp.
        focus: distance of the plane in focus along `direction`, metres.
        blades: sides of the aperture, 3 to 32, whose corners lie at the radius `aperture`; 0 is a round one.
        blade_rotation: of the aperture, degrees counter-clockwise as the camera sees it; at 0 a corner points up.
        name: for `--camera NAME`.
    """

    position: tuple[float, float, float] = field(default=(0.0, 0.0, 0.0), converter=lambda v: _vector(v, "position"))
    direction: tuple[float, float, float] = field(default=(0.0, 0.0, -1.0), converter=lambda v: _vector(v, "direction"))
    up: tuple[float, float, float] = field(default=(0.0, 1.0, 0.0), converter=lambda v: _vector(v, "up"))
    fov: float = DEFAULT_FOV
    aspect: float = 1.0
    aperture: float = 0.0
    focus: float = 1.0
    blades: int = 0
    blade_rotation: float = 0.0
    name: str = ""

    def __attrs_post_init__(self) -> None:
        limits = (
            *(("fov", 1e-3, 179.9), ("aspect", 1e-3, 1e3), ("aperture", 0.0, 1e6), ("focus", 1e-6, 1e9)),
            ("blade_rotation", -360.0, 360.0),
        )
        for name, low, high in limits:
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
                raise SceneError(f"camera: {name} is {value!r}: it must be a number from {low:g} to {high:g}")
        if type(self.blades) is not int or not (self.blades == 0 or 3 <= self.blades <= 32):
            raise SceneError(f"camera: blades is {self.blades!r}: it must be 0 for a round aperture, or from 3 to 32")
        right, _, _ = self.axes()
        if not np.isfinite(right).all():
            raise SceneError(f"camera: direction {self.direction} and up {self.up} must point in different ways")

    def axes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Right, up and backward as orthonormal float64 vectors; NaN where direction and up do not span a plane."""
        with np.errstate(invalid="ignore", divide="ignore"):
            backward = -np.asarray(self.direction, np.float64)
            backward /= np.linalg.norm(backward)
            up = np.asarray(self.up, np.float64)
            right = np.cross(up / np.linalg.norm(up), backward)
            length = np.linalg.norm(right)
            right = right / length if length > 1e-7 else np.full(3, np.nan)
        return right, np.cross(backward, right), backward

    def world_to_camera(self) -> np.ndarray:
        """(4, 4) float64 for column vectors, to the left-handed space of OpenEXR: x right, y up, z ahead."""
        right, up, backward = self.axes()
        matrix = np.eye(4)
        matrix[:3, :3] = right, up, -backward
        matrix[:3, 3] = -matrix[:3, :3] @ np.asarray(self.position)
        return matrix

    def camera_to_ndc(self, width: int, height: int, window: tuple[int, int, int, int]) -> np.ndarray:
        """(4, 4) float64 for column vectors: to (0, 0) at the top left corner of a window and (1, 1) at the opposite.

        A point is divided by its fourth coordinate, the depth; the third one is then 1 / depth.

        Args:
            width: of the full image, pixels.
            height: of the full image, pixels.
            window: x0, y0, x1, y1, the part of the full image.
        """
        left, top, right, bottom = window
        across, down = right - left, bottom - top
        half = math.tan(math.radians(self.fov) / 2)
        return np.array(
            [
                # Column and row in pixels grow with x / (half width) and -y / (half height), from the middle.
                (height / (2 * half * across), 0, (width / 2 - left) / across, 0),
                (0, -height / (2 * half * down), (height / 2 - top) / down, 0),
                (0, 0, 0, 1),
                (0, 0, 1, 0),
            ]
        )

    @classmethod
    def look_at(cls, position: Any, target: Any, up: Any = (0.0, 1.0, 0.0), **options: Any) -> Camera:
        """A camera at `position` that looks at the point `target` and focuses on it unless told otherwise."""
        direction = np.asarray(target, np.float64) - np.asarray(position, np.float64)
        options.setdefault("focus", float(np.linalg.norm(direction)) or 1.0)
        return cls(position=position, direction=direction, up=up, **options)
