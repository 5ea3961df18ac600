"""The camera."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from attrs import field, frozen

from ..errors import SceneError
from .values import float_array

PROJECTIONS = ("perspective", "orthographic", "panorama", "fisheye", "fisheye-equisolid")


def _vector(value: Any, name: str) -> tuple[float, float, float]:
    x, y, z = float_array(value, (3,), f"camera: {name}").tolist()
    return (x, y, z)


def _pair(value: Any, name: str) -> tuple[float, float]:
    float_array(value, (2,), f"camera: {name}")
    a, b = value
    return (float(a), float(b))


DEFAULT_FOV = math.degrees(2 * math.atan(0.5))

_LIMITS = {
    "fov": (1e-3, 179.9),
    "fisheye_fov": (1e-3, 360.0),
    "height": (1e-9, 1e9),
    "aspect": (1e-3, 1e3),
    "aperture": (0.0, 1e6),
    "focus": (1e-6, 1e9),
    "blade_rotation": (-360.0, 360.0),
}


@frozen(kw_only=True)
class Camera:
    """A camera: what it shows follows from its projection, what is sharp from its thin lens.

    Each projection has fields of its own; those of the others have no effect.

    Args:
        position: of the lens centre, metres.
        direction: where it looks; any length but 0.
        up: roughly upwards; made orthogonal to `direction`.
        projection: `perspective`; `orthographic`: parallel rays from the plane through the position; `panorama`:
            longitude and latitude, with `direction` in the middle (equirectangular); `fisheye`: a circle on black in
            which the distance from the middle is the angle from `direction` (equidistant); `fisheye-equisolid`: one in
            which equal areas are equal solid angles.
        fov: of `perspective`: vertical field of view, degrees, between 0 and 180.
        height: of `orthographic`: what the image shows from bottom to top, metres; None: what `perspective` would show
            at the distance `focus`. (glTF's `ymag` is half of it.)
        fisheye_fov: of fisheyes: field of view from edge to edge of the circle, degrees, up to 360.
        longitude: of `panorama`: at the left and at the right edge, degrees to the right of `direction`.
        latitude: of `panorama`: at the bottom and at the top edge, degrees, from -90 to 90.
        shift: moves the image to the right and upwards over what there is to see, in parts of its longer side, as in
            Blender; vertical lines stay vertical. A panorama has its angles instead.
        aspect: width / height of the image; see `image_aspect`.
        aperture: radius of the lens, metres; 0 is a pinhole: everything is sharp.
        focus: distance of the plane in focus along `direction`, metres; of panoramas and fisheyes, whose lens is turned
            towards every direction, radius of the sphere in focus.
        blades: sides of the aperture, 3 to 32, whose corners lie at the radius `aperture`; 0 is a round one.
        blade_rotation: of the aperture, degrees counter-clockwise as the camera sees it; at 0 a corner points up.
        name: for `--camera NAME`.

    Raises:
        SceneError: a value is out of its range; the message names the field.
    """

    position: tuple[float, float, float] = field(default=(0.0, 0.0, 0.0), converter=lambda v: _vector(v, "position"))
    direction: tuple[float, float, float] = field(default=(0.0, 0.0, -1.0), converter=lambda v: _vector(v, "direction"))
    up: tuple[float, float, float] = field(default=(0.0, 1.0, 0.0), converter=lambda v: _vector(v, "up"))
    projection: str = "perspective"
    fov: float = DEFAULT_FOV
    height: float | None = None
    fisheye_fov: float = 180.0
    longitude: tuple[float, float] = field(default=(-180.0, 180.0), converter=lambda v: _pair(v, "longitude"))
    latitude: tuple[float, float] = field(default=(-90.0, 90.0), converter=lambda v: _pair(v, "latitude"))
    shift: tuple[float, float] = field(default=(0.0, 0.0), converter=lambda v: _pair(v, "shift"))
    aspect: float = 1.0
    aperture: float = 0.0
    focus: float = 1.0
    blades: int = 0
    blade_rotation: float = 0.0
    name: str = ""

    def __attrs_post_init__(self) -> None:
        if self.projection not in PROJECTIONS:
            raise SceneError(f"camera: projection is {self.projection!r}: it must be one of {', '.join(PROJECTIONS)}")
        for name, (low, high) in _LIMITS.items():
            value = getattr(self, name)
            if name == "height" and value is None:
                continue
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
                raise SceneError(f"camera: {name} is {value!r}: it must be a number from {low:g} to {high:g}")
        if type(self.blades) is not int or not (self.blades == 0 or 3 <= self.blades <= 32):
            raise SceneError(f"camera: blades is {self.blades!r}: it must be 0 for a round aperture, or from 3 to 32")
        west, east = self.longitude
        if not -360 <= west < east <= 360 or east - west > 360:
            raise SceneError(f"camera: longitude is {self.longitude}: it must rise, by 360 at most, within -360 to 360")
        if not -90 <= self.latitude[0] < self.latitude[1] <= 90:
            raise SceneError(f"camera: latitude is {self.latitude}: it must rise, within -90 to 90")
        if not all(-10 <= part <= 10 for part in self.shift):
            raise SceneError(f"camera: shift is {self.shift}: each part must be from -10 to 10")
        right, _, _ = self.axes()
        if not np.isfinite(right).all():
            raise SceneError(f"camera: direction {self.direction} and up {self.up} must point in different ways")

    @property
    def image_aspect(self) -> float:
        """Width / height of an image of which only one is given: `aspect`, or what fits a panorama or a fisheye."""
        if self.projection == "panorama":
            return (self.longitude[1] - self.longitude[0]) / (self.latitude[1] - self.latitude[0])
        return 1.0 if self.projection.startswith("fisheye") else self.aspect

    @property
    def extent(self) -> float:
        """What an orthographic camera shows from bottom to top, metres."""
        return self.height if self.height is not None else 2 * math.tan(math.radians(self.fov) / 2) * self.focus

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

    def window(self, width: int, height: int) -> tuple[float, float, float, float]:
        """What an image of width x height pixels covers: half of its width and height, and its middle, x and y.

        In units of the image plane at distance 1 (perspective), metres (orthographic), turns of longitude and latitude
        (panorama), or radii of the circle, which touches the longer sides (fisheyes). Pixels are square, but for those
        of a panorama.
        """
        if self.projection == "panorama":
            (west, east), (bottom, top) = self.longitude, self.latitude
            return (east - west) / 720, (top - bottom) / 720, (east + west) / 720, (top + bottom) / 720
        if self.projection == "perspective":
            half_height = math.tan(math.radians(self.fov) / 2)
        elif self.projection == "orthographic":
            half_height = self.extent / 2
        else:
            half_height = height / min(width, height)
        # The shape of the pixels follows the image, so that nothing is distorted.
        half_width = half_height * width / height
        unit = 2 * max(half_width, half_height)
        return half_width, half_height, self.shift[0] * unit, self.shift[1] * unit

    def world_to_camera(self) -> np.ndarray:
        """(4, 4) float64 for column vectors, to the left-handed space of OpenEXR: x right, y up, z ahead."""
        right, up, backward = self.axes()
        matrix = np.eye(4)
        matrix[:3, :3] = right, up, -backward
        matrix[:3, 3] = -matrix[:3, :3] @ np.asarray(self.position)
        return matrix

    def camera_to_ndc(self, width: int, height: int, window: tuple[int, int, int, int]) -> np.ndarray | None:
        """(4, 4) float64 for column vectors: to (0, 0) at the top left corner of a window and (1, 1) at the opposite.

        A perspective point is divided by its fourth coordinate, the depth; the third one is then 1 / depth. An
        orthographic one has the fourth coordinate 1, and the third is the depth. None: no matrix does it for panoramas
        and fisheyes.

        Args:
            width: of the full image, pixels.
            height: of the full image, pixels.
            window: x0, y0, x1, y1, the part of the full image.
        """
        if self.projection not in ("perspective", "orthographic"):
            return None
        left, top, right, bottom = window
        half_width, half_height, middle_x, middle_y = self.window(width, height)
        # Pixels for each unit of x and y.
        scale_x, scale_y = width / (2 * half_width), height / (2 * half_height)
        across, down = right - left, bottom - top
        begin_x, begin_y = width / 2 - middle_x * scale_x - left, height / 2 + middle_y * scale_y - top
        rows = np.array([(scale_x / across, 0, begin_x / across, 0), (0, -scale_y / down, begin_y / down, 0)])
        if self.projection == "perspective":
            return np.array([*rows, (0, 0, 0, 1), (0, 0, 1, 0)])
        # What does not depend on the depth.
        return np.array([*rows[:, [0, 1, 3, 2]], (0, 0, 1, 0), (0, 0, 0, 1)])

    @classmethod
    def look_at(cls, position: Any, target: Any, up: Any = (0.0, 1.0, 0.0), **options: Any) -> Camera:
        """A camera at `position` that looks at the point `target` and focuses on it unless told otherwise."""
        direction = np.asarray(target, np.float64) - np.asarray(position, np.float64)
        options.setdefault("focus", float(np.linalg.norm(direction)) or 1.0)
        return cls(position=position, direction=direction, up=up, **options)
