"""The script that makes the pictures and tables of docs/comparison.md."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

import lumipath as lp

ROOT = Path(__file__).parents[2]
SCRIPT = runpy.run_path(str(ROOT / "docs" / "figures" / "comparison.py"))

ROOM = """SBT-raytracer 1.0
camera { position = (0, 1, 4); }
polymesh { material = { emissive = (5, 5, 5); };
    points = ((-1, 2, -1), (1, 2, -1), (1, 2, 1), (-1, 2, 1)); faces = ((0, 1, 2), (0, 2, 3)); }
polymesh { material = { diffuse = (0.5, 0.5, 0.5); };
    points = ((-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2)); faces = ((0, 1, 2), (0, 2, 3)); }
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "room.ray").write_text(ROOM, encoding="utf-8")
    (tmp_path / "room-ray.ray").write_text(ROOM + "point_light { position = (0, 1, 0); }\n", encoding="utf-8")
    (tmp_path / "other.ray").write_text(ROOM, encoding="utf-8")
    return tmp_path


def test_twins_are_for_whitted_only_and_others_get_a_light_below_their_lamp(folder):
    assert SCRIPT["names_in"](folder) == ["other", "room"]
    assert SCRIPT["scene_for"]("path", folder, "room").lights == []
    assert SCRIPT["scene_for"]("whitted", folder, "room").lights[0].position == (0, 1, 0)
    (light,) = SCRIPT["scene_for"]("whitted", folder, "other").lights
    np.testing.assert_allclose(light.position, (0, 2 - 0.002, 0), rtol=1e-6, atol=1e-6)


def test_every_run_adds_to_the_results_and_fills_the_page(folder, capsys):
    page = folder / "page.md"
    names = ("pictures", "times", "references")
    markers = [f"<!-- {name}: made by docs/figures/comparison.py -->\nold\n<!-- end of {name} -->" for name in names]
    page.write_text("\n".join(["before", *markers, "after"]), encoding="utf-8")
    np.save(folder / "room_r3.npy", np.full((16, 16, 3), 0.5, np.float32))
    common = [str(folder), "room", "--json", str(folder / "found.json"), "--page", str(page)]
    small = ["--width", "16", "--timed-size", "16", "--pictures", str(folder / "pictures")]
    SCRIPT["main"]([*common, *small, "--references", str(folder), "--spp", "4", "--no-times"])
    assert lp.Image.load(folder / "pictures" / "room-whitted.jpg").width == 16
    SCRIPT["main"]([*common, *small, "--no-pictures"])
    found = json.loads((folder / "found.json").read_text())["room"]
    assert set(found["times"]) == {"path cpu", "whitted cpu"}
    assert set(found["references"]) == {"schlick", "exact"}
    text = page.read_text()
    assert "old" not in text
    assert text.startswith("before\n")
    assert text.endswith("\nafter")
    assert f"Measured on: {found['times']['path cpu']['device']}." in text
    assert "| `room` | 4 | " in capsys.readouterr().out


def test_differences_are_of_block_means_without_lamps():
    rng = np.random.default_rng(1)
    ours = np.ones((64, 64, 3))
    reference = 2 + rng.normal(0, 0.8, ours.shape)
    lamps = np.zeros_like(ours)
    lamps[0, 0], reference[:8, :8] = 1, 1000
    found = SCRIPT["difference"](ours, reference, lamps)
    assert found["ratio"] == pytest.approx([0.5] * 3, rel=0.02)
    assert found["blocks"] == pytest.approx(1, rel=0.02)
    # Three channels of 0.8 make a mean of 0.46, and 64 pixels of that 0.058.
    assert found["noise"] == pytest.approx(0.8 / np.sqrt(3) / 8, rel=0.1)


def test_equal_pictures_differ_by_their_noise():
    rng = np.random.default_rng(2)
    ours = np.ones((128, 128, 3))
    found = SCRIPT["difference"](ours, ours + rng.normal(0, 0.5, ours.shape), np.zeros_like(ours))
    assert found["blocks"] == pytest.approx(found["noise"], rel=0.15)
    assert np.all(np.abs(np.array(found["ratio"]) - 1) < 4 * np.array(found["error"]))


def test_a_missing_scene_is_named(folder):
    with pytest.raises(SystemExit, match=r"there is no nothing\.ray"):
        SCRIPT["main"]([str(folder), "nothing"])


def test_the_pictures_of_the_page_are_small():
    files = list((ROOT / "docs" / "images" / "comparison").glob("*.jpg"))
    assert len(files) == 20
    assert sum(path.stat().st_size for path in files) < 250_000
