"""Draws the figure and prints the table of docs/sampling.md: the noise of each choice of samples and directions.

Run it from anywhere: `python docs/figures/variance.py`. It needs matplotlib and takes some minutes of both.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import lumipath as lp

# Each with the choices that change something there.
EVERYWHERE = ("default, no roulette", "--hemisphere uniform", "--sampler independent", "--rr-depth 4", "--rr-depth 1")
SCENES = {"cornell-box": EVERYWHERE, "primitives": EVERYWHERE, "glass": (*EVERYWHERE, "--fresnel schlick")}
# The first one is what the others are compared with. Roulette is off where it is not the subject.
CHOICES = {
    "default, no roulette": {},
    "--hemisphere uniform": {"hemisphere": "uniform"},
    "--sampler independent": {"sampler": "independent"},
    "--rr-depth 4": {"rr_depth": 4},
    "--rr-depth 1": {"rr_depth": 1},
    "--fresnel schlick": {"fresnel": "schlick"},
}
BASE = {"width": 96, "max_depth": 8, "rr_depth": None}
SAMPLES = (1, 4, 16, 64, 256)
TABLE_SAMPLES = 64
SEEDS = 8
REFERENCE_SPP = 8192

COLOURS = ("#000000", "#D55E00", "#0072B2", "#009E73", "#56B4E9", "#CC79A7")
STYLES = dict(zip(CHOICES, zip(COLOURS, "osD^vP")))


def relative_error(image, reference):
    """Mean over pixels and channels of the squared error over the squared radiance; 0.01 keeps black pixels finite."""
    return float(np.mean((np.asarray(image, np.float64) - reference) ** 2 / (reference**2 + 0.01)))


def errors_of(scene, reference, samples, seeds, settings):
    """(samples, seeds): the relative squared error of independent renders."""
    found = np.empty((len(samples), seeds))
    for row, spp in enumerate(samples):
        session = lp.Session(scene, spp=spp, **settings)
        for seed in range(seeds):
            session.restart(seed)
            found[row, seed] = relative_error(session.run(), reference)
    return found


def measure(scenes, samples, seeds, reference_spp, base):
    """{scene: {choice: (samples, seeds) errors}}."""
    results = {}
    for name, choices in scenes.items():
        scene = lp.builtin(name)
        # With a seed that no other render has.
        reference = np.asarray(lp.render(scene, spp=reference_spp, seed=1 << 20, **base), np.float64)
        results[name] = {}
        for choice in choices:
            print(f"{name}: {choice}", flush=True)
            results[name][choice] = errors_of(scene, reference, samples, seeds, {**base, **CHOICES[choice]})
    return results


def draw(results, samples, output):
    """One panel a scene: error over samples per pixel, one line a choice."""
    figure = Figure(figsize=(3.6 * len(results), 3.9), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(results)))
    for axes, (scene, errors) in zip(panels, results.items()):
        for choice, found in errors.items():
            colour, mark = STYLES[choice]
            axes.plot(samples, found.mean(axis=1), color=colour, marker=mark, markersize=4, linewidth=1.2, label=choice)
        axes.set_title(scene, fontsize=10)
        axes.set_xscale("log", base=2)
        axes.set_yscale("log")
        axes.set_xticks(samples, [str(number) for number in samples])
        axes.minorticks_off()
        axes.set_xlabel("samples per pixel")
        axes.grid(color="#dddddd", linewidth=0.6)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("relative squared error")
    handles = {line.get_label(): line for axes in panels for line in axes.get_lines()}
    figure.legend(handles=handles.values(), loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    # Without a date, equal numbers make equal files.
    figure.savefig(output, metadata={"Date": None} if Path(output).suffix == ".svg" else None)


def table(results, samples, at):
    """Rows of Markdown: error over that of the first choice, and its standard error, at so many samples."""
    row = list(samples).index(at)
    lines = [f"| choice | {' | '.join(f'`{scene}`' for scene in results)} |", "|---|" + "---|" * len(results)]
    for choice in dict.fromkeys(choice for errors in results.values() for choice in list(errors)[1:]):
        cells = [_ratio(errors, choice, row) if choice in errors else "" for errors in results.values()]
        lines.append(f"| `{choice}` | {' | '.join(cells)} |")
    return "\n".join(lines)


def _ratio(errors, choice, row):
    ours, theirs = errors[choice][row], next(iter(errors.values()))[row]
    ratio = ours.mean() / theirs.mean()
    spread = [np.std(found, ddof=1) / np.sqrt(len(found)) / found.mean() for found in (ours, theirs)]
    return f"{ratio:.2f} ± {ratio * np.hypot(*spread):.2f}"


def main(
    output=Path(__file__).parents[1] / "images" / "variance.svg",
    scenes=SCENES,
    samples=SAMPLES,
    at=TABLE_SAMPLES,
    seeds=SEEDS,
    reference_spp=REFERENCE_SPP,
    width=BASE["width"],
):
    """Measure, draw to `output`, and print the table at `at` samples per pixel."""
    results = measure(scenes, samples, seeds, reference_spp, {**BASE, "width": width})
    draw(results, samples, output)
    print(table(results, samples, at))


if __name__ == "__main__":
    main()
