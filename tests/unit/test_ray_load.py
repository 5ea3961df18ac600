"""`load`: the reader is chosen by the suffix."""

import os
import subprocess
import sys

import pytest

from lumipath.errors import SceneError
from lumipath.formats import files, load

SPHERE = "SBT-raytracer 1.0 sphere { }"


@pytest.mark.parametrize("name", ["a.ray", "A.RAY", "with space.Ray"])
def test_by_suffix(tmp_path, name):
    (tmp_path / name).write_text(SPHERE)
    assert len(load(tmp_path / name).shapes) == 1
    assert len(load(str(tmp_path / name)).shapes) == 1


def test_errors(tmp_path):
    (tmp_path / "a.xyz").write_text("")
    (tmp_path / "none").write_text("")
    (tmp_path / "empty.ray").write_text("")
    for name, message in {
        "missing.ray": r"missing\.ray': No such file",
        "": "is a folder",
        "a.xyz": r"a\.xyz': the suffix '\.xyz' is not known; known are .*\.ray",
        "none": "suffix '' is not known",
        "empty.ray": r"empty\.ray:1:1: the file is empty",
    }.items():
        with pytest.raises(SceneError, match=message) as caught:
            load(tmp_path / name)
        assert "\n" not in str(caught.value)


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.ray")
    with pytest.raises(SceneError, match="not a regular file"):
        load(tmp_path / "pipe.ray")


def test_no_permission(tmp_path, monkeypatch):
    (tmp_path / "a.ray").write_text(SPHERE)

    def refuse(*args):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(files.Path, "open", refuse)
    with pytest.raises(SceneError, match=r"a\.ray': Permission denied"):
        load(tmp_path / "a.ray")


def test_the_package_imports_no_reader():
    code = "import sys, lumipath.formats; print([name for name in ('lark', 'OpenImageIO') if name in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_a_large_mesh_is_read_whole(tmp_path):
    count = 40_000
    points = ",\r\n".join(f"( {i * 0.001234567:.7f}, {i % 7}.25, -{i}e-005 )" for i in range(count))
    corners = ",\n".join(f"( {i}, {i + 1}, {i + 2} )" for i in range(count - 2))
    file = tmp_path / "large.ray"
    file.write_text(f"SBT-raytracer 1.0\npolymesh {{ points=( {points} ); faces=( {corners} ); gennormals; }}")
    (mesh,) = load(file).shapes
    assert (mesh.vertices.shape, mesh.faces.shape) == ((count, 3), (count - 2, 3))
    assert mesh.faces[-1].tolist() == [count - 3, count - 2, count - 1]
