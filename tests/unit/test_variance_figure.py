"""The script that makes the figure and the table of docs/sampling.md."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

SCRIPT = runpy.run_path(str(Path(__file__).parents[2] / "docs" / "figures" / "variance.py"))


def test_it_draws_and_prints_a_table(tmp_path, capsys):
    output = tmp_path / "variance.svg"
    scenes = {"cornell-box": ("default, no roulette", "--rr-depth 1")}
    SCRIPT["main"](output=output, scenes=scenes, samples=(1, 4), at=4, seeds=2, reference_spp=64, width=8)
    assert "</svg>" in output.read_text()
    *_, head, rule, row = capsys.readouterr().out.splitlines()
    assert (head, rule) == ("| choice | `cornell-box` |", "|---|---|")
    assert row.startswith("| `--rr-depth 1` | ")
    assert float(row.split("|")[2].split("±")[0]) > 0


def test_the_error_is_relative_and_squared():
    reference = np.full((2, 2, 3), 3.0)
    assert SCRIPT["relative_error"](np.full((2, 2, 3), 4.0, np.float32), reference) == pytest.approx(1 / 9.01)


def test_ratios_come_with_their_standard_error():
    errors = {"first": np.array([[2.0, 2.0]]), "other": np.array([[5.0, 7.0]])}
    table = SCRIPT["table"]({"scene": errors, "empty": {"first": errors["first"]}}, (64,), 64)
    # The mean of 5 and 7 has the standard error 1.
    assert table.splitlines()[-1] == "| `other` | 3.00 ± 0.50 |  |"


def test_every_choice_is_drawn_in_a_style_of_its_own():
    styles = SCRIPT["STYLES"]
    assert set(styles) == set(SCRIPT["CHOICES"])
    assert len(set(styles.values())) == len(styles)
    assert {choice for choices in SCRIPT["SCENES"].values() for choice in choices} == set(styles)
