"""Rays leave primitives that are far larger than what is seen of them."""

import numpy as np
import pytest

from lumipath import Camera, Environment, Material, Scene, Sphere, render


@pytest.mark.parametrize(("radius", "height"), [(1000.0, 2.0), (100.0, 0.02), (1e4, 2.0)])
def test_a_huge_ball_as_the_ground_does_not_shadow_itself(device, radius, height):
    transform = np.diag([radius, radius, radius, 1.0])
    transform[1, 3] = -radius
    ground = Sphere(transform=transform, material=Material(diffuse=1.0))
    sky = Environment(image=np.ones((4, 8, 3)))
    camera = Camera(position=(0.0, height, 0.0), direction=(0.0, -1.0, -0.5))
    scene = Scene(shapes=[ground], environment=sky, cameras=[camera])
    image = np.asarray(render(scene, device=device, width=16, spp=256, max_depth=1, rr_depth=None))
    # Albedo 1 under a sky of 1 is 1; self-shadowing took a third to two thirds.
    np.testing.assert_allclose(image, 1.0, rtol=0.01)
