"""A scene with instances looks like the same scene with copies in their place."""

from __future__ import annotations

import json

import numpy as np
import pytest
from parts import floor, moved, quad, scaled, sky, sphere_mesh, turned

from lumipath.rendering.session import Session, render
from lumipath.scene import (
    AmbientLight,
    Camera,
    Cone,
    DirectionalLight,
    Environment,
    Group,
    Instance,
    Material,
    Mesh,
    PointLight,
    Scene,
    Sphere,
    Texture,
)

SIZE = {"width": 72, "height": 48}


def chequers():
    return Texture(image=np.kron([[1, 0], [0, 1]], np.full((4, 4), 0.6))[..., None].repeat(3, axis=2) + 0.2)


def figure():
    """All kinds of shapes and materials: matt, mirror, glass, a lamp, textures, blends, smooth normals, one side."""
    red, blue = Material(diffuse=(0.7, 0.1, 0.1), name="red"), Material(diffuse=(0.1, 0.1, 0.7), name="blue")
    corners = ((-0.5, 0, 0.3), (0.5, 0, 0.3), (0.5, 0.5, 0.3), (-0.5, 0.5, 0.3))
    return Group(
        [
            sphere_mesh(8, smooth=True, transform=moved(0, 1.2, 0) @ scaled(0.4), material=Material(diffuse=0.6)),
            quad(*corners, uv=True, material=Material(diffuse=chequers(), name="chequers")),
            Mesh(
                vertices=((-0.5, 0.5, 0.25), (0.5, 0.5, 0.25), (0, 1, 0.25)),
                faces=[(0, 1, 2)],
                vertex_materials=(red, blue, Material(diffuse=0.5, specular=0.3)),
                two_sided=False,
            ),
            Sphere(
                transform=moved(-0.6, 0.5, 0.4) @ scaled(0.25),
                material=Material(transmissive=(0.8, 0.9, 0.8), index=1.5, name="glass"),
            ),
            Cone(
                transform=moved(0.6, 0, 0.4) @ turned("x", -90),
                bottom_radius=0.3,
                material=Material(specular=0.7, diffuse=0.2, name="metal"),
            ),
            Sphere(transform=moved(0, 1.75, 0) @ scaled(0.08), material=Material(emission=6.0, name="bulb")),
        ]
    )


PLACES = {
    "moved": moved(-2.2, 0, 0),
    "turned": moved(0, 0, 0.4) @ turned("y", 30) @ turned("z", 10),
    "mirrored": moved(2.2, 0, 0) @ scaled(-1.0, 1.0, 1.0),
    "stretched": moved(-1.2, 0, -2) @ scaled(0.8, 1.6, 0.8) @ turned("y", 200),
    "small": moved(1.0, 0, 1.6) @ scaled(0.4),
}
CAMERA = Camera.look_at((0.4, 2.0, 6.5), (0, 0.8, 0), fov=40, aspect=1.5)
LIGHTS = [
    PointLight(position=(1, 4, 3), colour=2.0),
    DirectionalLight(direction=(-1, -2, -1)),
    AmbientLight(colour=0.1),
]


def scene(*, copied):
    """Figures on a floor; one of them all of copper."""
    target = figure()
    copper = Material(diffuse=(0.6, 0.3, 0.15), name="copper")
    placed = [Instance(target, transform=place, name=name) for name, place in PLACES.items()]
    placed.append(Instance(target, transform=moved(1.4, 0, -1.6) @ turned("y", -50), material=copper, name="copper"))
    shapes = [floor(8.0, material=Material(diffuse=0.5), name="floor")]
    shapes += [copy for shape in placed for copy in shape.copies()] if copied else placed
    background = Environment(image=sky(1.0).image, scale=0.3)
    return Scene(shapes=shapes, lights=LIGHTS, cameras=[CAMERA], environment=background)


def assert_alike(image, reference, differing=0.02):
    """Almost all pixels equal to 2e-3; where rounding sends a path another way, one differs."""
    image, reference = np.asarray(image), np.asarray(reference)
    error = np.abs(image - reference).max(axis=2)
    assert (error > 2e-3 * np.maximum(np.abs(reference).max(axis=2), 1.0)).mean() <= differing
    np.testing.assert_allclose(image.mean(axis=(0, 1)), reference.mean(axis=(0, 1)), rtol=5e-3)


def both(**settings):
    """The two renders of the same settings."""
    return (render(scene(copied=copied), **SIZE, **settings) for copied in (False, True))


def test_instances_look_like_copies(device):
    assert_alike(*both(device=device, spp=16, max_depth=6))


@pytest.mark.parametrize("integrator", ["whitted", "normal", "ao"])
def test_instances_look_like_copies_to_every_integrator(device, integrator):
    assert_alike(*both(device=device, spp=4, integrator=integrator), differing=0.03)


def test_layers_of_instances(device):
    names = ("albedo", "geometric_normal", "position", "uv", "object_id", "material_id")
    placed, copied = both(device=device, spp=4, integrator="albedo", aov=names)
    for name in ("albedo", "geometric_normal", "position", "uv"):
        assert_alike(placed[name], copied[name], differing=0.03)
    objects, materials = (json.loads(placed.metadata[key]) for key in ("object_names", "material_names"))
    copies = json.loads(copied.metadata["material_names"])
    assert objects == ["floor", *PLACES, "copper"]
    # Each figure has six parts.
    number = copied["object_id"][..., 0]
    wanted = np.where(number > 0, (number - 1) // 6 + 1, number)
    assert (placed["object_id"][..., 0] == wanted).mean() > 0.99
    assert set(np.unique(wanted)) == set(range(-1, 7)) or set(np.unique(wanted)) == set(range(7))
    ours, theirs = placed["material_id"][..., 0], copied["material_id"][..., 0]
    known = (ours >= 0) & (theirs >= 0)
    named = [materials[k] == copies[j] for k, j in zip(ours[known], theirs[known], strict=True)]
    # Of a face that blends materials, another corner comes first in a mirrored copy.
    assert np.mean(named) > 0.98
    assert "copper" in {materials[k] for k in np.unique(ours[known])}


def test_focus_on_finds_instances(device):
    pixel = {"focus_on": (36, 22), "aperture": 0.1}
    settings = {**SIZE, **pixel, "spp": 1, "max_depth": 0}
    placed, copied = (Session(scene(copied=c), device=device, **settings).focus for c in (False, True))
    assert placed == pytest.approx(copied, rel=1e-4)
    assert 3 < placed < 9


# ---- leaving a surface -----------------------------------------------------------------------------------------------


def glowing_room(transform):
    """White balls within a closed sphere that emits 0.5 and reflects 0.5: every pixel is 1. And their size."""
    ball = sphere_mesh(16, smooth=True, material=Material(diffuse=1.0))
    shapes = [Instance(ball, transform=transform @ moved(k, 0, 0) @ scaled(0.3)) for k in (-1, 0, 1)]
    size = np.abs(transform[:3, :3]).sum(axis=1).max()
    shell = Sphere(transform=moved(*transform[:3, 3]) @ scaled(6 * size), material=Material(diffuse=0.5, emission=0.5))
    return shapes, shell, size


SCALES = {
    "tiny": scaled(1e-3),
    "huge": scaled(1e3),
    "far": moved(300, -200, 400),
    "stretched": turned("z", 30) @ scaled(0.05, 5.0, 1.0) @ turned("y", 20),
    "mirrored": scaled(1.0, -1.0, 1.0),
}


@pytest.mark.parametrize("kind", SCALES)
def test_a_white_instance_in_a_furnace_neither_leaks_nor_shadows_itself(device, kind):
    transform = SCALES[kind]
    shapes, shell, size = glowing_room(transform)
    centre = transform[:3, 3]
    camera = Camera.look_at(tuple(centre + (0, 0, 4 * size)), tuple(centre), fov=30)
    scene = Scene(shapes=[*shapes, shell], cameras=[camera])
    image = render(scene, width=24, spp=64, max_depth=64, rr_depth=None, device=device)
    np.testing.assert_allclose(np.asarray(image).mean(), 1.0, rtol=2e-3)
    assert np.abs(np.asarray(image) - 1).max() < 0.25
