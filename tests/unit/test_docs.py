"""The documentation says what is there: flags, settings, links, and code that runs."""

import os
import re
import subprocess
import sys
from pathlib import Path

import attrs
import pytest
import typer

import lumipath
from lumipath.cli import _app
from lumipath.cli._config import OLD_NAMES, WITHOUT_EFFECT, read_config
from lumipath.cli._settings import SETTINGS, SHORT_FLAGS
from lumipath.scenes import names
from lumipath.settings import RenderSettings

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("examples/*.md")],
    key=lambda page: page.relative_to(ROOT).as_posix(),
)
PAGE_NAMES = [page.relative_to(ROOT).as_posix() for page in PAGES]
SOURCES = str(Path(lumipath.__path__[0]).parent)

FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


def read(name):
    return (ROOT / name).read_text(encoding="utf-8")


def python_blocks(name):
    return [body for language, body in FENCE.findall(read(name)) if language == "python"]


def run_python(code, folder):
    """Run code in a process and folder of its own; what it prints."""
    environment = {**os.environ, "PYTHONPATH": SOURCES}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=folder, env=environment, timeout=600
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


# ---- command line and settings ---------------------------------------------------------------------------------------


def commands(command=None, path=("lumipath",)):
    """Every command of the command line, with the words that lead there."""
    command = command or typer.main.get_command(_app)
    yield " ".join(path), command
    for name, inner in getattr(command, "commands", {}).items():
        yield from commands(inner, (*path, name))


COMMANDS = dict(commands())


@pytest.mark.parametrize("path", COMMANDS)
def test_every_command_and_flag_is_documented(path):
    page = read("docs/command-line.md")
    assert f"`{path}" in page
    for parameter in COMMANDS[path].params:
        for flag in [*parameter.opts, *parameter.secondary_opts]:
            assert not flag.startswith("-") or f"`{flag}" in page, f"{path}: {flag}"


def row_of(setting):
    """The row of a setting in the table of the command-line page."""
    default = getattr(RenderSettings(), setting.name)
    flags = [*([SHORT_FLAGS[setting.name]] if setting.name in SHORT_FLAGS else []), setting.flag]
    value = setting.metavar(default).replace("|", r"\|")
    unit = f" ({setting.unit})" if setting.unit else ""
    shown = "" if default in (None, ()) else f"`{default}`"
    return f"| `{'`, `'.join(flags)} {value}` | {setting.help.rstrip('.')}{unit}. | {shown} |"


@pytest.mark.parametrize("setting", SETTINGS.values(), ids=lambda setting: setting.name)
def test_the_table_of_settings_is_that_of_the_code(setting):
    assert row_of(setting) in read("docs/command-line.md"), f"the table needs this row:\n{row_of(setting)}"


@pytest.mark.parametrize("field", attrs.fields(RenderSettings), ids=lambda field: field.name)
def test_every_setting_is_in_the_python_page(field):
    assert f"`{field.name}`" in read("docs/python.md")


@pytest.mark.parametrize("scene", names())
def test_every_built_in_scene_is_documented(scene):
    assert f"`{scene}`" in read("docs/command-line.md")


@pytest.mark.parametrize("name", [name for name in lumipath.__all__ if name != "__version__"])
def test_every_public_name_is_documented(name):
    assert re.search(rf"\b{name}\b", read("docs/python.md"))


def test_the_changelog_knows_this_version():
    assert f"## [{lumipath.__version__}]" in read("CHANGELOG.md") or "## [Unreleased]" in read("CHANGELOG.md")


# ---- pages -----------------------------------------------------------------------------------------------------------


def anchors_of(page):
    """The anchors that headings get on code hosting sites."""
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("name", PAGE_NAMES)
def test_relative_links_lead_somewhere(name):
    page = ROOT / name
    for target in LINK.findall(FENCE.sub("", read(name))):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        place = (page.parent / path).resolve() if path else page
        assert place.exists(), f"{name} links to {target}"
        assert place.is_relative_to(ROOT), f"{name} links out of the repository: {target}"
        if anchor:
            assert anchor in anchors_of(place), f"{name} links to {target}"


def test_every_page_is_linked_from_another():
    linked = {
        (page.parent / target.partition("#")[0]).resolve()
        for page in PAGES
        for target in LINK.findall(page.read_text(encoding="utf-8"))
    }
    lonely = [name for name, page in zip(PAGE_NAMES, PAGES, strict=True) if page not in linked and name != "README.md"]
    assert lonely == []


def test_every_decision_is_in_their_list_once():
    pages = sorted(page.name for page in ROOT.glob("docs/decisions/[0-9]*.md"))
    assert LINK.findall(read("docs/decisions/README.md")) == pages


@pytest.mark.parametrize("name", PAGE_NAMES)
def test_source_files_that_pages_name_are_there(name):
    text = FENCE.sub("", read(name))
    for path in re.findall(r"`((?:src|tests|docs|examples)/[\w./-]+|[a-z_]+/(?:[a-z_]+/)*[\w-]+\.(?:py|lark))`", text):
        places = [ROOT / path, ROOT / "src" / "lumipath" / path]
        assert any(place.exists() for place in places), f"{name} names {path}"


@pytest.mark.parametrize("name", PAGE_NAMES)
def test_python_blocks_compile(name):
    for body in python_blocks(name):
        compile(body, name, "exec")


# ---- code that runs --------------------------------------------------------------------------------------------------


def tiny(code):
    """The code with images of a few pixels and samples."""
    code = re.sub(r"\bwidth=\d+", "width=16", code)
    return re.sub(r"\bspp=\d+", "spp=2", code)


@pytest.mark.parametrize("name", ["README.md", "docs/python.md"])
def test_python_blocks_run(name, tmp_path):
    (tmp_path / "room.ray").write_text(read("examples/room.ray"), encoding="utf-8")
    run_python(tiny("\n".join(python_blocks(name))), tmp_path)


RAY_BLOCKS = [body for language, body in FENCE.findall(read("docs/ray-language.md")) if language == "text"]


@pytest.mark.parametrize("number", range(len(RAY_BLOCKS)))
def test_ray_examples_can_be_read(number):
    from lumipath.formats.ray import parse_ray

    body = RAY_BLOCKS[number]
    parse_ray(body if "SBT-raytracer" in body else f"SBT-raytracer 1.0\n{body}")


def test_configurations_can_be_read(tmp_path):
    bodies = [body for language, body in FENCE.findall(read("docs/command-line.md")) if language == "json"]
    assert bodies
    for body in bodies:
        (tmp_path / "params.json").write_text(body, encoding="utf-8")
        assert read_config(tmp_path / "params.json") != RenderSettings()


@pytest.mark.parametrize("key", [*OLD_NAMES, *WITHOUT_EFFECT, "anti_alias"])
def test_every_key_of_the_student_tracer_is_documented(key):
    assert f"`{key}`" in read("docs/command-line.md")


def test_every_built_in_scene_has_a_picture_of_its_own_and_together_they_are_small():
    page = read("docs/scenes.md")
    folder = ROOT / "docs" / "images" / "scenes"
    for name in names():
        assert f"![{name}](images/scenes/{name}.jpg) | `{name}` |" in page
    assert {path.name for path in folder.iterdir()} == {f"{name}.jpg" for name in names()}
    assert sum(path.stat().st_size for path in folder.iterdir()) < 600_000


def test_the_script_of_the_pictures_runs(tmp_path):
    script = ROOT / "docs" / "thumbnails.py"
    run_python(
        f"import runpy, pathlib; main = runpy.run_path({str(script)!r})['main'];"
        "main(['cornell-box'], pathlib.Path('pictures'), width=16, spp=2)",
        tmp_path,
    )
    assert lumipath.Image.load(tmp_path / "pictures" / "cornell-box.jpg").width == 16


def test_the_script_of_the_pictures_of_cameras_runs(tmp_path):
    script = ROOT / "docs" / "camera_pictures.py"
    found = run_python(
        f"import runpy, pathlib; module = runpy.run_path({str(script)!r}); print(*module['PICTURES']);"
        "module['main'](['filter-box'], pathlib.Path('pictures'), width=8, spp=2)",
        tmp_path,
    )
    assert lumipath.Image.load(tmp_path / "pictures" / "filter-box.png").width == 64
    there = {path.stem for path in (ROOT / "docs" / "images" / "cameras").iterdir()}
    assert there == set(found.splitlines()[0].split())
    assert all(f"(images/cameras/{name}." in read("docs/cameras.md") for name in there)


@pytest.mark.parametrize("name", ["render_a_file", "build_a_scene", "progressive"])
def test_examples_run(name, tmp_path):
    path = ROOT / "examples" / f"{name}.py"
    output = tmp_path / "image.png"
    run_python(
        f"import runpy; runpy.run_path({str(path)!r})['main'](output={str(output)!r}, width=16, spp=4)", tmp_path
    )
    assert lumipath.Image.load(output).width == 16


def test_there_is_a_test_for_every_example():
    scripts = {path.stem for path in (ROOT / "examples").glob("*.py")}
    assert scripts == {"render_a_file", "build_a_scene", "progressive"}
