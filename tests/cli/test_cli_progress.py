import io
import json

import pytest
from fake_session import Progress

from lumipath.cli._progress import BarReporter, JsonReporter, LineReporter, Summary, describe, duration, make_reporter

HALF = Progress(32, 64, 4.0, 10_000_000)


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_lines_are_two_seconds_apart():
    times = iter([0.0, 1.0, 2.5, 3.0, 5.0])
    stream = io.StringIO()
    reporter = LineReporter(stream, clock=lambda: next(times))
    for _ in range(5):
        reporter.update(HALF)
    assert stream.getvalue().splitlines() == [" 50.0 %  32/64 spp  2.5 Mpaths/s  4 s left"] * 2


def test_time_is_shown_where_it_is_limited():
    assert describe(Progress(32, None, 4.0, 10_000_000, 16.0)) == "32 spp  4/16 s  2.5 Mpaths/s  12 s left"


def test_noise_is_shown_where_it_is_known():
    assert describe(Progress(32, 64, 4.0, 10_000_000, noise=0.1234)) == "32/64 spp  noise 0.12  2.5 Mpaths/s  4 s left"


def test_the_summary_says_what_pixels_have():
    summary = Summary("done", 187.25, None, 3.0, 2.0, "cpu", "Fake", "a.png", 32, 768, 0.0498)
    assert summary.line() == "187.2 spp (32 to 768), noise 0.05 in 3.00 s, 2 Mpaths/s on cpu (Fake): wrote a.png"


def test_json_has_no_infinity():
    stream = io.StringIO()
    JsonReporter(stream).update(Progress(0, 64, 1.0, 0))
    assert json.loads(stream.getvalue())["remaining_seconds"] is None


def test_bar_needs_a_terminal():
    assert isinstance(make_reporter("auto", stream=Terminal()), BarReporter)
    assert isinstance(make_reporter("bar", stream=Terminal()), BarReporter)
    assert isinstance(make_reporter("auto", stream=io.StringIO()), LineReporter)
    assert isinstance(make_reporter("bar", stream=io.StringIO()), LineReporter)


def test_bar_shows_the_figures_and_goes_away(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    stream = Terminal()
    with make_reporter("auto", stream=stream) as reporter:
        reporter.update(HALF)
    assert "32/64 spp  2.5 Mpaths/s  4 s left" in stream.getvalue()
    # The cursor that the bar hid is back.
    assert "\x1b[?25h" in stream.getvalue()


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.2, "0 s"), (59.4, "59 s"), (200, "3 min 20 s"), (7500, "2 h 05 min"), (59.6, "1 min 00 s")]
)
def test_duration(seconds, text):
    assert duration(seconds) == text


def test_summary_of_an_interrupted_render():
    summary = Summary("interrupted", 24.5, 64, 3.0, 2.0, "cpu", "Fake", "a.png")
    assert summary.line() == "interrupted: 24.5 of 64 spp in 3.00 s, 2 Mpaths/s on cpu (Fake): wrote a.png"
