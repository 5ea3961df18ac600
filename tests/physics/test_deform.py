"""Frames of an animation: what a session shows after `deform` is what a new one shows of a scene with such meshes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import attrs
import numpy as np
import pytest
from parts import floor, moved, scaled, sphere_mesh

from lumipath.errors import CheckpointError, LumipathError, SceneError, UsageError
from lumipath.rendering import session as session_module
from lumipath.rendering.session import Session
from lumipath.scene import Camera, Group, Instance, Material, Mesh, Scene, smooth_normals, with_meshes

SETTINGS = {"width": 24, "height": 16, "spp": 16, "max_depth": 3, "rr_depth": None}
CAMERA = Camera.look_at((0, 2, 5), (0, 0.5, 0), fov=45, aspect=1.5)
WHITE, LAMP = Material(diffuse=0.7), Material(emission=(40, 30, 20))


def room(*shapes: Any, **options: Any) -> Scene:
    return Scene(shapes=[floor(4.0, material=WHITE), *shapes], cameras=[CAMERA], **options)


def ball(**options: Any) -> Mesh:
    return sphere_mesh(12, transform=moved(0, 0.8, 0) @ scaled(0.6), **{"material": WHITE, **options})


def lamp() -> Mesh:
    return sphere_mesh(3, transform=moved(1.5, 2, 0.5) @ scaled(0.2), material=LAMP)


def bent(mesh: Mesh, amount: float) -> np.ndarray:
    """(N, 3): the vertices of a mesh, each higher by what its place says."""
    x, y, z = mesh.vertices.T
    return np.stack([x + 0.3 * amount * y, y * (1 + amount), z - amount * np.sin(2 * x)], axis=-1)


def shown(scene: Scene, device: str, **settings: Any) -> np.ndarray:
    return np.asarray(Session(scene, device=device, **{**SETTINGS, **settings}).run())


def assert_alike(image: Any, reference: np.ndarray) -> None:
    """Equal but for rounding, and for a pixel or two in which it sends a path another way."""
    error = np.abs(np.asarray(image) - reference).max(axis=2)
    assert (error > 1e-4 * np.maximum(reference.max(axis=2), 0.1)).sum() <= 2
    assert reference.max() > 0.1


def test_each_frame_is_the_picture_of_a_new_session(device):
    mesh, light = ball(), lamp()
    scene = room(mesh, light)
    session = Session(scene, device=device, **SETTINGS)
    first = np.asarray(session.run())
    for amount in (0.1, 0.5, -0.3):
        session.deform({mesh: bent(mesh, amount)})
        assert session.film.samples == 0
        image = session.run()
        moved_scene = with_meshes(scene, {mesh: attrs.evolve(mesh, vertices=bent(mesh, amount))})
        assert_alike(image, shown(moved_scene, device))
        assert image.metadata["samples"] == SETTINGS["spp"]
        assert np.abs(np.asarray(image) - first).max() > 0.05
    # What is not named stays as it is, and meshes may be named as they are by now.
    session.deform({session.scene.shapes[2]: light.vertices + np.float32([0, 0.3, 0])})
    meshes = {
        mesh: attrs.evolve(mesh, vertices=bent(mesh, -0.3)),
        light: attrs.evolve(light, vertices=light.vertices + np.float32([0, 0.3, 0])),
    }
    assert_alike(session.run(), shown(with_meshes(scene, meshes), device))
    # The scene that was given has not changed, and its picture comes back.
    assert scene.shapes[1] is mesh
    session.deform({mesh: mesh.vertices, light: light.vertices})
    assert_alike(session.run(), first)


def test_a_lamp_that_grows_gives_more_light(device):
    light = sphere_mesh(3, transform=moved(0, 2, 0) @ scaled(0.1), material=Material(emission=400))
    ground = floor(4.0, material=Material(diffuse=0.5))
    scene = Scene(shapes=[ground, light], cameras=[CAMERA])
    settings = {"crop": (0, 12, 24, 16), "max_depth": 1, "spp": 64}
    session = Session(scene, device=device, **{**SETTINGS, **settings})
    small = np.asarray(session.run())
    centre = light.vertices.mean(axis=0)
    larger = centre + 2 * (light.vertices - centre)
    session.deform({light: larger})
    large = np.asarray(session.run())
    assert_alike(large, shown(with_meshes(scene, {light: attrs.evolve(light, vertices=larger)}), device, **settings))
    # Twice the size is four times the power, far away.
    assert large.mean() / small.mean() == pytest.approx(4, rel=0.1)


def test_what_instances_place_moves_with_its_mesh(device):
    mesh, light = ball(), sphere_mesh(2, transform=moved(0, 1.8, 0) @ scaled(0.1), material=LAMP)
    plant = Group([mesh, light])
    scene = room(*(Instance(plant, transform=moved(2 * k, 0, -k) @ scaled(1, 1 + 0.2 * k, 1)) for k in (-1, 0, 1)))
    session = Session(scene, device=device, **SETTINGS)
    first = np.asarray(session.run())
    session.deform({mesh: bent(mesh, 0.3), light: bent(light, 0.2)})
    meshes = {one: attrs.evolve(one, vertices=bent(one, amount)) for one, amount in ((mesh, 0.3), (light, 0.2))}
    image = session.run()
    assert_alike(image, shown(with_meshes(scene, meshes), device))
    assert np.abs(np.asarray(image) - first).max() > 0.05


def test_normals_follow_the_faces_unless_they_are_given(device):
    mesh = ball(smooth=True)
    scene = room(mesh, lamp())
    session = Session(scene, device=device, **SETTINGS)
    positions = bent(mesh, 0.6)
    session.deform({mesh: positions})
    made = attrs.evolve(mesh, vertices=positions, normals=smooth_normals(np.float32(positions), mesh.faces))
    assert_alike(session.run(), shown(with_meshes(scene, {mesh: made}), device))
    mine = np.broadcast_to((0, 0, 2.0), mesh.vertices.shape)
    session.deform({mesh: positions}, normals={mesh: mine})
    given = attrs.evolve(mesh, vertices=positions, normals=mine)
    assert_alike(session.run(), shown(with_meshes(scene, {mesh: given}), device))


def test_a_flat_mesh_may_be_given_normals(device):
    # Other features, so other kernels.
    mesh = ball()
    scene = room(mesh, lamp())
    session = Session(scene, device=device, **SETTINGS)
    normals = smooth_normals(mesh.vertices, mesh.faces)
    session.deform({mesh: mesh.vertices}, {mesh: normals})
    smooth = with_meshes(scene, {mesh: attrs.evolve(mesh, normals=normals)})
    assert_alike(session.run(), shown(smooth, device))


def test_layers_and_focus_follow(device):
    mesh = ball()
    scene = room(mesh, lamp())
    settings = {"aov": ("depth", "object_id"), "focus_on": (12, 8)}
    session = Session(scene, device=device, **SETTINGS, **settings)
    session.run()
    before = session.focus
    positions = mesh.vertices + np.float32([0, 0, 1])
    session.deform({mesh: positions})
    image = session.run()
    after = with_meshes(scene, {mesh: attrs.evolve(mesh, vertices=positions)})
    fresh = Session(after, device=device, **SETTINGS, **settings)
    want = fresh.run()
    assert session.focus == pytest.approx(fresh.focus, rel=1e-6)
    assert session.focus < before - 0.5
    np.testing.assert_allclose(image["depth"], want["depth"], rtol=1e-5)
    np.testing.assert_array_equal(image["object_id"], want["object_id"])


# ---- what does not depend on the device ------------------------------------------------------------------------------


@pytest.fixture
def animated():
    """A mesh, a scene with it, and a session."""
    mesh = attrs.evolve(ball(), name="ball")
    scene = room(mesh, lamp())
    return mesh, scene, Session(scene, device="cpu", **SETTINGS)


def film_bits(session: Session) -> bytes:
    return session.film.total.tobytes() + session.film.counts.tobytes()


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda mesh: ({mesh: mesh.vertices[1:]},), SceneError, r"mesh 'ball': vertices must have the shape 312 x 3"),
        (lambda mesh: ({mesh: mesh.vertices[:, :2]},), SceneError, "312 x 3, not 312 x 2"),
        (lambda mesh: ({mesh: np.full((312, 3), np.nan)},), SceneError, r"vertices\[0, 0\] is nan"),
        (lambda mesh: ({mesh: mesh.vertices * 1e13},), SceneError, "at most 1e"),
        (lambda mesh: ({mesh: "here"},), SceneError, "must be numbers"),
        (lambda mesh: ({mesh: mesh.vertices}, {mesh: mesh.vertices[1:]}), SceneError, "normals must have the shape"),
        (lambda mesh: ({}, {mesh: mesh.vertices}), UsageError, "mesh 'ball' is given normals, but no vertices"),
        (lambda mesh: ({ball(): mesh.vertices},), UsageError, "a mesh is not in the scene"),
        (lambda mesh: ({"ball": mesh.vertices},), UsageError, "takes meshes, not a str"),
        (lambda mesh: ([mesh.vertices],), UsageError, "dictionary of meshes"),
        (lambda mesh: ({mesh: mesh.vertices}, [mesh.vertices]), UsageError, "dictionary of meshes"),
    ],
)
def test_what_is_wrong_is_told_in_a_line_and_changes_nothing(animated, make, error, message):
    mesh, _, session = animated
    image, before = np.asarray(session.run()), film_bits(session)
    with pytest.raises(error, match=message) as caught:
        session.deform(*make(mesh))
    assert isinstance(caught.value, LumipathError)
    assert "\n" not in str(caught.value)
    assert film_bits(session) == before
    np.testing.assert_array_equal(np.asarray(session.image()), image)


def test_nothing_to_focus_on_changes_nothing(animated):
    mesh, scene, _ = animated
    above = attrs.evolve(scene, shapes=[mesh])
    session = Session(above, device="cpu", focus_on=(12, 8), **SETTINGS)
    image, focus = np.asarray(session.run()), session.focus
    with pytest.raises(UsageError, match="shows only the background"):
        session.deform({mesh: mesh.vertices + np.float32([0, 50, 0])})
    assert session.focus == focus
    session.restart(0)
    np.testing.assert_array_equal(np.asarray(session.run()), image)


def test_films_of_different_frames_do_not_mix(animated, tmp_path):
    mesh, scene, session = animated
    session.run()
    session.save_checkpoint(tmp_path / "0.ckpt")
    digest = session.image().metadata["scene_hash"]
    session.deform({mesh: bent(mesh, 0.2)})
    with pytest.raises(CheckpointError, match="its scene is another one"):
        session.load_checkpoint(tmp_path / "0.ckpt")
    session.run()
    session.save_checkpoint(tmp_path / "1.ckpt")
    assert session.image().metadata["scene_hash"] != digest
    # A new session of that frame may go on with its film, and this one with that of the first.
    after = with_meshes(scene, {mesh: attrs.evolve(mesh, vertices=bent(mesh, 0.2))})
    other = Session(after, device="cpu", checkpoint=tmp_path / "1.ckpt", resume=True, **SETTINGS)
    assert other.resumed == SETTINGS["spp"]
    session.deform({mesh: mesh.vertices})
    session.load_checkpoint(tmp_path / "0.ckpt")
    assert session.image().metadata["scene_hash"] == digest


def test_a_session_that_writes_a_checkpoint_does_not_deform(animated, tmp_path):
    mesh, scene, _ = animated
    session = Session(scene, device="cpu", checkpoint=tmp_path / "a.ckpt", **SETTINGS)
    image = np.asarray(session.run())
    with pytest.raises(UsageError, match=r"a\.ckpt, which is of one picture"):
        session.deform({mesh: bent(mesh, 0.2)})
    np.testing.assert_array_equal(np.asarray(session.image()), image)


def test_deforming_in_the_middle_of_a_pass_begins_anew(animated, eager):
    mesh, scene, session = animated
    frames = 0
    for progress in session:
        if frames < 3 and progress.samples > 0:
            frames += 1
            session.deform({mesh: bent(mesh, 0.1 * frames)})
            assert session.render_seconds == 0
            assert session.film.samples == 0
    assert frames == 3
    assert (session.film.counts == SETTINGS["spp"]).all()
    after = with_meshes(scene, {mesh: attrs.evolve(mesh, vertices=bent(mesh, 0.3))})
    assert_alike(session.image(), shown(after, "cpu"))


@pytest.mark.parametrize("anew", ["deform", "restart"])
def test_beginning_anew_in_the_middle_of_a_pass_leaves_the_time_before_out(animated, eager, monkeypatch, anew):
    mesh, _, session = animated
    clock = SimpleNamespace(now=0.0, perf_counter=lambda: clock.now)
    monkeypatch.setattr(session_module, "time", clock)
    began = False
    for _ in session:
        clock.now += 1
        if not began:
            began = True
            clock.now += 1000
            session.deform({mesh: bent(mesh, 0.1)}) if anew == "deform" else session.restart(3)
    assert 0 < session.render_seconds < 1000


def test_restarting_keeps_the_frame(animated):
    mesh, scene, session = animated
    session.deform({mesh: bent(mesh, 0.4)})
    session.restart(7)
    after = with_meshes(scene, {mesh: attrs.evolve(mesh, vertices=bent(mesh, 0.4))})
    assert_alike(session.run(), shown(after, "cpu", seed=7))


def test_lists_of_the_scene_may_change_behind_a_session(animated):
    mesh, scene, session = animated
    scene.shapes.append(sphere_mesh(2, material=WHITE))
    session.deform({mesh: bent(mesh, 0.4)})
    after = with_meshes(room(mesh, scene.shapes[2]), {mesh: attrs.evolve(mesh, vertices=bent(mesh, 0.4))})
    assert_alike(session.run(), shown(after, "cpu"))
