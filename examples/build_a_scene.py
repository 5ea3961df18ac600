"""Build a scene in Python: a floor, a lamp, and a row of balls from matt to glass."""

import numpy as np

import lumipath as lp


def quad(*corners, **options):
    """Four corners, counter-clockwise seen from the front, as a mesh of two triangles."""
    return lp.Mesh(vertices=corners, faces=[(0, 1, 2), (0, 2, 3)], **options)


def ball(x, radius, material):
    """A ball that stands on the floor."""
    transform = np.diag([radius, radius, radius, 1.0])
    transform[:3, 3] = x, radius, 0.0
    return lp.Sphere(transform=transform, material=material)


def build():
    """The scene."""
    grey = lp.Material(diffuse=0.5)
    lamp = lp.Material(emission=(12.0, 11.0, 9.0))
    balls = [
        lp.Material(diffuse=(0.7, 0.2, 0.1), name="matt"),
        lp.Material(diffuse=(0.1, 0.3, 0.6), specular=0.05, name="polished"),
        lp.Material(specular=0.9, name="mirror"),
        lp.Material(transmissive=(0.5, 0.9, 0.7), index=1.5, name="green glass"),
    ]
    return lp.Scene(
        name="balls",
        shapes=[
            quad((-4, 0, 4), (4, 0, 4), (4, 0, -4), (-4, 0, -4), material=grey, name="floor"),
            # A lamp with a dark back: not two-sided, and its front is below.
            quad((-1, 3, -1), (1, 3, -1), (1, 3, 1), (-1, 3, 1), material=lamp, two_sided=False, name="lamp"),
            *(ball(x, 0.4, material) for x, material in zip((-1.5, -0.5, 0.5, 1.5), balls)),
        ],
        cameras=[lp.Camera.look_at((0.0, 1.4, 5.0), (0.0, 0.5, 0.0), fov=35.0, aspect=1.6)],
    )


def main(output="balls.png", width=480, spp=256):
    """Render it and write the image."""
    image = lp.render(build(), width=width, spp=spp)
    image.save(output, exposure=0.5, tonemap="agx")
    print(f"{image}: wrote {output}")


if __name__ == "__main__":
    main()
