"""Renders the scenes of the student path tracer, and fills the tables of docs/comparison.md.

    python docs/figures/comparison.py FOLDER [--references FOLDER] [--device cuda] [--json FILE] [--page]

FOLDER holds the student's .ray files, which are no part of this repository. It needs lumipath's own dependencies only.
Without further flags it writes small pictures and measures how long rendering takes on the CPU. Numbers go to a JSON
file, to which every run adds; `--page` writes the tables of all runs into the page.
"""

from __future__ import annotations

import argparse
import json
import sys
import warnings
from pathlib import Path

import attrs
import numpy as np

import lumipath as lp
from lumipath.bench.throughput import measure
from lumipath.settings import RenderSettings

DOCS = Path(__file__).parents[1]
PAGE = DOCS / "comparison.md"
PICTURES = DOCS / "images" / "comparison"
RESULTS = Path(__file__).with_suffix(".json")

# A file of this ending is the same scene with a point light, for classic ray tracing.
TWIN = "-ray"
BOUNCES = 3
PATH = {"integrator": "path", "max_depth": BOUNCES, "rr_depth": None, "fresnel": "schlick"}
WHITTED = {"integrator": "whitted", "max_depth": BOUNCES}
PICTURE = {"path": {**PATH, "spp": 4096, "fresnel": "exact"}, "whitted": {**WHITTED, "spp": 64}}
TIMED = {"path": {**PATH, "spp": 128}, "whitted": {**WHITTED, "spp": 16}}
TIMED_SIZE = 512
REFERENCE_SPP = 256
BLOCK = 8


# ---- scenes ----------------------------------------------------------------------------------------------------------


def names_in(folder):
    """The scenes of a folder, without the twins for classic ray tracing."""
    return sorted(path.stem for path in Path(folder).glob("*.ray") if not path.stem.endswith(TWIN))


def lamp_of(scene):
    """The mesh that emits most, or None."""
    lamps = [shape for shape in scene.shapes if isinstance(shape, lp.Mesh) and max(shape.material.emission) > 0]
    return max(lamps, key=lambda shape: max(shape.material.emission), default=None)


def light_below(lamp):
    """A white point light in the middle of a lamp, just off its surface; every scene of the twins has one like it."""
    a, b, c = (lamp.vertices[lamp.faces[:, corner]].astype(np.float64) for corner in range(3))
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1) / 2
    middle = (areas[:, None] * (a + b + c) / 3).sum(axis=0) / areas.sum()
    down = normals.sum(axis=0) / np.linalg.norm(normals.sum(axis=0))
    return lp.PointLight(position=middle + 1e-3 * np.sqrt(areas.sum()) * down, attenuation=(1.0, 0.0, 0.0))


def scene_for(integrator, folder, name):
    """The scene as a path tracer gets it, or as a classic ray tracer does: with a point light."""
    twin = Path(folder) / f"{name}{TWIN}.ray"
    if integrator == "whitted" and twin.exists():
        return lp.load(twin)
    scene = lp.load(Path(folder) / f"{name}.ray")
    lamp = lamp_of(scene)
    if integrator == "whitted" and not scene.lights and lamp is not None:
        return attrs.evolve(scene, lights=[light_below(lamp)])
    return scene


# ---- what is measured ------------------------------------------------------------------------------------------------


def picture(scene, integrator, output, width, device):
    """Render one small picture to a file."""
    lp.render(scene, width=width, device=device, **PICTURE[integrator]).save(output)


def seconds(scene, integrator, size, device):
    """How long rendering takes: the median of three, without building and compiling; and on what."""
    settings = RenderSettings(width=size, height=size, **TIMED[integrator])
    found = measure(scene, settings, device=device)
    return {
        "seconds": size * size * settings.spp / found.median / 1e6,
        "device": found.device,
        "size": size,
        "spp": settings.spp,
    }


def on_the_grid_of(reference, scene, spp, **changes):
    """Our picture on the reference's grid, whose pixels lie half a pixel further left and down."""
    height, width, _ = reference.shape
    settings = {**PATH, **changes}
    fine = np.asarray(lp.render(scene, width=2 * width, height=2 * height, spp=spp, **settings), np.float64)
    shifted = np.pad(fine, ((0, 1), (1, 0), (0, 0)), "edge")[1:, :-1]
    return shifted.reshape(height, 2, width, 2, 3).mean(axis=(1, 3))


def blocks(image, size=BLOCK):
    """(blocks, size * size, 3): the pixels of whole blocks; what is left over at the edges is not counted."""
    height, width, _ = image.shape
    rows, columns = height // size, width // size
    cut = image[: rows * size, : columns * size].reshape(rows, size, columns, size, 3)
    return cut.transpose(0, 2, 1, 3, 4).reshape(rows * columns, size * size, 3)


def difference(ours, reference, lamps):
    """How two pictures differ, by means over blocks, where no lamp is in the block.

    Args:
        ours: (H, W, 3) radiance, of little noise.
        reference: (H, W, 3) radiance; its noise is estimated from how it scatters about ours within a block.
        lamps: (H, W, 3) what is seen of lamps directly.

    Returns:
        `ratio` of the means, ours over theirs, by channel, and its standard `error`; `blocks`: the relative difference
        of a block, root of the mean square; `noise`: what that would be if both were equal.
    """
    dark = blocks(lamps).max(axis=(1, 2)) == 0
    here, there = blocks(ours)[dark], blocks(reference)[dark]
    variance = (there - here).var(axis=1, ddof=1) / here.shape[1]
    grey_variance = (there - here).mean(axis=2).var(axis=1, ddof=1) / here.shape[1]
    mean_here, mean_there = here.mean(axis=1), there.mean(axis=1)
    total = mean_there.mean(axis=0)
    scale = mean_here.mean(axis=1).clip(0.01 * mean_here.mean())
    gap = (mean_here - mean_there).mean(axis=1)
    return {
        "ratio": (mean_here.mean(axis=0) / total).tolist(),
        "error": (np.sqrt(variance.sum(axis=0)) / len(variance) / total).tolist(),
        "blocks": float(np.sqrt(np.mean((gap / scale) ** 2))),
        "noise": float(np.sqrt(np.mean(grey_variance / scale**2))),
    }


def compare(scene, reference, spp):
    """The differences to the student's picture, with its formula for Fresnel's reflection and with the exact one."""
    lamps = on_the_grid_of(reference, scene, 16, max_depth=0)
    return {
        fresnel: difference(on_the_grid_of(reference, scene, spp, fresnel=fresnel), reference, lamps)
        for fresnel in ("schlick", "exact")
    }


# ---- results ---------------------------------------------------------------------------------------------------------


def read_results(path):
    """What earlier runs have found."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def write_results(path, results):
    """Replace the file as a whole, so that an interrupted run loses nothing."""
    temporary = path.with_name(f".{path.name}.part")
    temporary.write_text(json.dumps(results, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    temporary.replace(path)


def _row(*cells):
    return f"| {' | '.join(cells)} |"


def _head(*cells):
    return [_row(*cells), "|" + "---|" * len(cells)]


def pictures_table(results):
    """Both pictures of each scene."""
    lines = _head("scene", "path tracing", "Whitted")
    for name in results:
        shown = [f"![{name}, {kind}](images/comparison/{name}-{kind}.jpg)" for kind in ("path", "whitted")]
        lines.append(_row(f"`{name}`", *shown))
    return lines


def _seconds(entry):
    return f"{entry['seconds']:.3g}" if entry else ""


def times_table(results):
    """Seconds of each scene by integrator and kind of device."""
    kinds = ("cpu", "cuda")
    columns = [f"{integrator}, {kind.upper()}" for integrator in ("path tracing", "Whitted") for kind in kinds]
    lines = _head("scene", "triangles", *columns)
    for name, found in results.items():
        times = [found.get("times", {}).get(f"{way} {kind}") for way in ("path", "whitted") for kind in kinds]
        lines.append(_row(f"`{name}`", f"{found['triangles']:,}", *map(_seconds, times)))
    return lines


def devices_line(results):
    """Where the times come from."""
    entries = [entry for found in results.values() for entry in found.get("times", {}).values()]
    devices = dict.fromkeys(entry["device"] for entry in entries)
    return [f"Measured on: {'; '.join(devices)}."] if devices else ["Not measured yet."]


def references_table(results):
    """How each scene differs from the student's picture."""
    lines = _head("scene", "R", "G", "B", "blocks", "noise", "exact Fresnel: R", "G", "B")
    for name, found in results.items():
        if "references" not in found:
            continue
        near, exact = found["references"]["schlick"], found["references"]["exact"]
        cells = [f"{ratio:.3f} ± {error:.3f}" for ratio, error in zip(near["ratio"], near["error"], strict=True)]
        percents = [f"{100 * near[key]:.1f} %" for key in ("blocks", "noise")]
        lines.append(_row(f"`{name}`", *cells, *percents, *(f"{ratio:.3f}" for ratio in exact["ratio"])))
    return lines


def tables(results):
    """{marker: lines of Markdown}."""
    times = [*times_table(results), "", *devices_line(results)]
    return {"pictures": pictures_table(results), "times": times, "references": references_table(results)}


def fill_page(page, filled):
    """Put each table between the two markers of its name."""
    text = page.read_text(encoding="utf-8")
    for name, lines in filled.items():
        start, end = f"<!-- {name}: made by docs/figures/comparison.py -->", f"<!-- end of {name} -->"
        before, found, rest = text.partition(start)
        _, found_end, after = rest.partition(end)
        if not (found and found_end):
            sys.exit(f"{page}: the markers of the table {name!r} are missing: {start} and {end}")
        text = "\n".join([before + start, *lines, end + after])
    page.write_text(text, encoding="utf-8")


# ---- the run ---------------------------------------------------------------------------------------------------------


def measure_scene(name, entry, options):
    """Everything that was asked for of one scene; adds to `entry`."""
    for integrator in ("path", "whitted"):
        scene = scene_for(integrator, options.folder, name)
        if integrator == "path":
            entry["triangles"] = scene.triangle_count
        if not options.no_pictures:
            output = options.pictures / f"{name}-{integrator}.jpg"
            picture(scene, integrator, output, options.width, options.device)
        if not options.no_times:
            kind = options.device.partition(":")[0]
            found = seconds(scene, integrator, options.timed_size, options.device)
            entry.setdefault("times", {})[f"{integrator} {kind}"] = found
    reference = options.references and options.references / f"{name}_r{BOUNCES}.npy"
    if reference and reference.exists():
        entry["references"] = compare(scene_for("path", options.folder, name), np.load(reference), options.spp)


def arguments(argv):
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder with the .ray files")
    parser.add_argument("scenes", nargs="*", help="only these, by name without .ray")
    parser.add_argument("--references", type=Path, help=f"folder with NAME_r{BOUNCES}.npy; missing ones are left out")
    parser.add_argument("--device", default="cpu", help="cpu, cuda or cuda:N; default cpu")
    parser.add_argument("--json", type=Path, default=RESULTS, help="file of results, to which this run adds")
    parser.add_argument("--pictures", type=Path, default=PICTURES, help="folder for the pictures")
    parser.add_argument("--no-pictures", action="store_true", help="leave the pictures as they are")
    parser.add_argument("--no-times", action="store_true", help="measure no times")
    parser.add_argument("--page", nargs="?", type=Path, const=PAGE, help="write the tables into the page")
    parser.add_argument("--width", type=int, default=160, help="of the pictures, pixels")
    parser.add_argument("--timed-size", type=int, default=TIMED_SIZE, help="width and height of what is timed")
    parser.add_argument("--spp", type=int, default=REFERENCE_SPP, help="for the comparison with references, x 4")
    return parser.parse_args(argv)


def main(argv=None):
    """Render, measure, and print the tables."""
    options = arguments(argv)
    wanted = options.scenes or names_in(options.folder)
    missing = [name for name in wanted if not (options.folder / f"{name}.ray").exists()]
    if missing or not wanted:
        sys.exit(f"{options.folder}: there is no {', '.join(f'{name}.ray' for name in missing) or '.ray file'}")
    options.pictures.mkdir(parents=True, exist_ok=True)
    # A lamp of area lights nothing in Whitted ray tracing; that is known here.
    warnings.simplefilter("ignore", lp.LumipathWarning)
    results = read_results(options.json)
    try:
        for name in wanted:
            print(name, file=sys.stderr, flush=True)
            measure_scene(name, results.setdefault(name, {}), options)
            write_results(options.json, results)
    except lp.LumipathError as error:
        sys.exit(str(error))
    results = dict(sorted(results.items()))
    filled = tables(results)
    print("\n\n".join("\n".join(lines) for lines in filled.values()))
    if options.page:
        fill_page(options.page, filled)


if __name__ == "__main__":
    main()
