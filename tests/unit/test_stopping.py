"""When a session stops: by samples, by time, or by both; on a device and a clock of its own."""

import threading
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from lumipath.rendering import session as module
from lumipath.rendering import stopping
from lumipath.rendering.session import Session
from lumipath.scenes import builtin
from lumipath.settings import RenderSettings

STEP = 0.25


class Clock:
    """Time that passes only when somebody works, and timers that keep to it."""

    def __init__(self):
        self.now = 100.0
        self.timers = []

    def perf_counter(self):
        return self.now

    def pass_by(self, seconds):
        due = [timer for timer in self.timers if timer.at <= self.now + seconds]
        for timer in due:
            self.now = max(self.now, timer.at)
            self.timers.remove(timer)
            timer.function()
            return
        self.now += seconds

    def timer(self, seconds, function):
        made = SimpleNamespace(at=self.now + seconds, function=function, daemon=False)
        made.start = lambda: self.timers.append(made)
        made.cancel = lambda: made in self.timers and self.timers.remove(made)
        return made


class Device:
    """Adds a sample to every pixel each quarter of a second."""

    kind, name, even_counts = "cpu", "fake", False

    def __init__(self, clock, stop):
        self.clock, self.stop = clock, stop
        self.cancelled = False

    def draft(self, packed):
        return packed.scene

    def stand_in(self, packed):
        return partial(int)

    def upload(self, packed):
        return packed.scene

    def compile(self, scene, view, film):
        pass

    def next_stop(self, done, pixels):
        return self.stop

    def render(self, scene, view, film, last):
        self.cancelled = False
        while film.counts.min() < last and not self.cancelled:
            self.clock.pass_by(STEP)
            film.counts[...] += 1
            yield 0

    def cancel(self):
        self.cancelled = True

    def download(self, film):
        pass

    def clear(self):
        pass


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    monkeypatch.setattr(module, "time", SimpleNamespace(perf_counter=made.perf_counter))
    monkeypatch.setattr(stopping, "threading", SimpleNamespace(Timer=made.timer, TIMEOUT_MAX=threading.TIMEOUT_MAX))
    return made


@pytest.fixture
def session(clock, monkeypatch):
    def make(stop=1 << 40, **settings):
        monkeypatch.setattr(module, "open_device", lambda *_: Device(clock, stop))
        return Session(builtin("bench-cornell"), width=4, **settings)

    return make


def test_without_time_the_samples_decide(session):
    made = session(spp=7)
    assert [progress.samples for progress in made] == [1, 2, 3, 4, 5, 6, 7]


def test_without_either_there_are_64_samples(session):
    assert session().run().metadata["samples"] == 64


@pytest.mark.parametrize("stop", [1 << 40, 1])
def test_time_alone_stops_in_the_middle_of_a_step(session, stop):
    made = session(stop if stop > 1 else 1 << 40, time=10.1)
    made.run()
    # A timer ends the pass; the device's own steps are a quarter of a second.
    assert made.render_seconds == pytest.approx(10.1)
    assert made.film.samples == 41
    assert not made.progress().total


def test_every_pixel_gets_a_sample_however_short_the_time(session):
    made = session(time=0.01)
    made.run()
    assert made.film.counts.min() == 1


def test_samples_may_end_it_before_the_time(session):
    made = session(time=10.0, spp=5)
    made.run()
    assert made.film.samples == 5
    assert made.progress().fraction == 1


def test_time_in_which_a_step_is_looked_at_counts(session, clock):
    made = session(time=10.0)
    for _ in made:
        # The device goes on meanwhile.
        clock.now += 3.0
    assert 10.0 <= made.render_seconds + 1e-3 <= 10.0 + 3.0 + STEP


def test_a_time_of_a_hundred_hours(session, clock):
    hours = 3600.0
    made = session(time=100 * hours)
    for number, progress in enumerate(made):
        if number == 3:
            assert len(clock.timers) == 1
            assert progress.remaining_seconds == pytest.approx(100 * hours - progress.seconds)
            # A day in which nobody looked.
            clock.now += 24 * hours
        if number == 4:
            assert progress.seconds == pytest.approx(24 * hours, rel=1e-4)
            assert progress.fraction == pytest.approx(0.24, rel=1e-3)
            clock.now += 75.999 * hours
    # The timer was set to the end, and the device went on until then.
    assert made.render_seconds == pytest.approx(100 * hours, rel=1e-6)
    assert not clock.timers
    assert made.film.samples > 5


def test_a_time_longer_than_threads_can_wait_takes_several_passes(session, clock):
    made = session(time=10.0)
    stopping.threading.TIMEOUT_MAX = 4.0
    made.run()
    assert made.render_seconds == pytest.approx(10.0, abs=STEP)


def test_a_real_timer_takes_a_hundred_hours():
    device = SimpleNamespace(cancel=lambda: pytest.fail("the time is not up"))
    film = SimpleNamespace(counts=np.ones((1, 1)))
    rules = stopping.StopRules(RenderSettings(time=360_000.0), film)
    with rules.in_time(1.0, device):
        (timer,) = (thread for thread in threading.enumerate() if isinstance(thread, threading.Timer))
        assert timer.interval == 359_999.0
        assert timer.daemon
    timer.join(10)
    assert not timer.is_alive()


def test_no_timer_is_left(session, clock):
    made = session(time=10.0)
    for progress in made:
        if progress.samples == 3:
            break
    assert not clock.timers
    made.run()
    assert not clock.timers
    assert made.render_seconds == pytest.approx(10.0, abs=STEP)


def test_fraction_and_remaining_time_follow_what_ends_first(session):
    for progress in session(time=10.0, spp=1000):
        assert progress.fraction == pytest.approx(progress.seconds / 10.0)
        assert progress.remaining_seconds == pytest.approx(10.0 - progress.seconds)
    for progress in session(time=1000.0, spp=10):
        assert progress.fraction == pytest.approx(progress.samples / 10)
