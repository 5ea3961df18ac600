"""Light from infinitely far away: look-up and importance sampling (pbrt, 4th edition, section 12.5.2)."""

from __future__ import annotations

from ..lang import Vec3, f32, i32, kernel, load4, sqrt, struct
from ..pack.layout import ENVIRONMENT
from .alias import pick_alias
from .functions import acos_turn, atan2_turn, cos_sin_turn, floor_int
from .vectors import black, dot, xyz


@struct
class EnvironmentSample:
    """A direction, the radiance from there, and the density of drawing it, per solid angle."""

    direction: Vec3
    radiance: Vec3
    pdf: f32


@kernel
def environment_coordinates(scene, direction):
    """Column and row, from 0 to 1, where a world direction meets the image."""
    frame = scene.environment_frame
    x = dot(xyz(load4(frame, 0)), direction)
    y = dot(xyz(load4(frame, 4)), direction)
    z = dot(xyz(load4(frame, 8)), direction)
    u = atan2_turn(x, -z) + 0.5
    return (u - 1.0 if u >= 1.0 else u), acos_turn(y)


@kernel
def texel(scene, column, row):
    """Four floats of a texel; columns wrap around, rows end at the poles. Of no direction, NaN, it is any texel."""
    width = scene.environment_width
    column = i32(column + width) if column < 0 else column
    column = i32(column - width) if column >= width else column
    column = min(max(column, i32(0)), i32(width - 1))
    row = min(max(row, i32(0)), i32(scene.environment_height - 1))
    return load4(scene.environment, (row * width + column) * 4)


@kernel
def environment_at(scene, u, v):
    """Radiance at column u and row v, from 0 to 1, interpolated between texels."""
    x = u * f32(scene.environment_width) - 0.5
    y = v * f32(scene.environment_height) - 0.5
    column = floor_int(x)
    row = floor_int(y)
    fx = x - f32(column)
    fy = y - f32(row)
    top = xyz(texel(scene, column, row)) * (1.0 - fx) + xyz(texel(scene, i32(column + 1), row)) * fx
    below = i32(row + 1)
    bottom = xyz(texel(scene, column, below)) * (1.0 - fx) + xyz(texel(scene, i32(column + 1), below)) * fx
    return top * (1.0 - fy) + bottom * fy


@kernel
def environment_density(scene, u, v, sine):
    """Density of `sample_environment` per solid angle."""
    column = min(i32(u * f32(scene.environment_width)), i32(scene.environment_width - 1))
    row = min(i32(v * f32(scene.environment_height)), i32(scene.environment_height - 1))
    return texel(scene, column, row)[3] / max(sine, 1e-6)


@kernel
def no_environment(scene, direction):
    """Darkness."""
    return EnvironmentSample(direction, black(), 0.0)


@kernel(needs=ENVIRONMENT, otherwise=no_environment)
def environment_from(scene, direction):
    """Radiance from a world direction, and the density with which `sample_environment` draws it."""
    u, v = environment_coordinates(scene, direction)
    x = dot(xyz(load4(scene.environment_frame, 0)), direction)
    z = dot(xyz(load4(scene.environment_frame, 8)), direction)
    sine = sqrt(x * x + z * z)
    return EnvironmentSample(direction, environment_at(scene, u, v), environment_density(scene, u, v, sine))


@kernel
def sample_environment(scene, a, b):
    """A direction with a density proportional to the radiance of its texel."""
    width = scene.environment_width
    row = pick_alias(scene.environment_rows, 0, scene.environment_height, b)
    column = pick_alias(scene.environment_cells, row.index * width, width, a)
    u = (f32(column.index) + column.rest) / f32(width)
    v = (f32(row.index) + row.rest) / f32(scene.environment_height)
    cosine, sine = cos_sin_turn(v * 0.5)
    # Column 0.5 lies along -z and 0.75 along +x.
    minus_z, x = cos_sin_turn(u + 0.5 if u < 0.5 else u - 0.5)
    local = Vec3(x * sine, cosine, -minus_z * sine)
    frame = scene.environment_frame
    direction = xyz(load4(frame, 0)) * local.x + xyz(load4(frame, 4)) * local.y + xyz(load4(frame, 8)) * local.z
    return EnvironmentSample(direction, environment_at(scene, u, v), environment_density(scene, u, v, sine))
