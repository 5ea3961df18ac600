"""Render a scene file: python render_a_file.py [FILE [OUTPUT]]."""

import sys
from pathlib import Path

import lumipath as lp

ROOM = Path(__file__).with_name("room.ray")


def main(source=ROOM, output="room.png", width=400, spp=128):
    """Render `source` and write the image."""
    scene = lp.load(source)
    print(f"{scene.name}: {scene.triangle_count} triangles, {len(scene.shapes)} shapes")
    image = lp.render(scene, width=width, spp=spp, progress=lambda p: print(f"{100 * p.fraction:.0f} %"))
    image.save(output)
    print(f"{image.width} x {image.height} pixels, {image.metadata['samples']:g} spp: wrote {output}")


if __name__ == "__main__":
    main(*sys.argv[1:])
