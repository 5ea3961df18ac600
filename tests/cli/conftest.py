import os
import subprocess
import sys
from pathlib import Path

import fake_session
import pytest

import lumipath as package
import lumipath.lang  # Numba takes seconds to load on a busy machine, which the command line would tell.
from lumipath.cli import main

FAKE = Path(__file__).with_name("fake_session.py")
# A relative PYTHONPATH would not lead there from another folder.
SOURCES = str(Path(package.__path__[0]).parent)


@pytest.fixture
def fake(monkeypatch):
    """A Session without kernels; returns the list of those that were made."""
    monkeypatch.setitem(sys.modules, "lumipath.rendering.session", fake_session.as_module())
    fake_session.MADE.clear()
    return fake_session.MADE


@pytest.fixture
def lumipath(capsys, tmp_path, monkeypatch):
    """Run the command line in this process, in an empty folder: (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        code = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run


@pytest.fixture
def start(tmp_path):
    """Start the command line with the fake Session as a process of its own, in an empty folder."""
    started = []

    def begin(*arguments, fault=""):
        process = subprocess.Popen(
            [sys.executable, str(FAKE), *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=tmp_path,
            env={**os.environ, "PYTHONPATH": SOURCES, "FAKE_FAULT": fault},
        )
        started.append(process)
        return process

    yield begin
    for process in started:
        process.kill()
        process.communicate()
