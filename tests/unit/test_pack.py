"""From a scene to flat arrays: features, lights, boxes, records."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from parts import hidden, quad, scaled, sky, sphere_mesh, turned

from lumipath.errors import LumipathWarning, SceneError
from lumipath.lang import features_of
from lumipath.pack import layout
from lumipath.pack.geometry import quadric_box
from lumipath.pack.scene import film_layers, pack_scene, settings_features
from lumipath.scene import (
    AmbientLight,
    Box,
    Camera,
    Cone,
    Cylinder,
    Diffuse,
    DirectionalLight,
    Environment,
    Material,
    Mesh,
    PointLight,
    Scene,
    Sky,
    Sphere,
    SpotLight,
    Square,
    Texture,
)
from lumipath.settings import RenderSettings

GLOW = Material(emission=2.0)
GLASS = layout.DIELECTRICS | layout.LOBE_GLASS
TEXTURE = Texture(image=np.full((2, 3, 3), 0.5))


def mask_of(*shapes, lights=(), environment=None):
    return features_of(pack_scene(Scene(shapes=shapes, lights=lights, environment=environment)).scene)


@pytest.mark.parametrize(
    ("scene", "expected"),
    [
        ({"shapes": [Box()]}, 0),
        ({"shapes": [Box(material=Material(specular=0.1))]}, layout.MIRRORS | layout.LOBE_MIRRORS),
        ({"shapes": [Box(material=Material(reflective=0.1))]}, layout.MIRRORS | layout.LOBE_MIRRORS),
        ({"shapes": [Box(material=Material(specular=0.0, reflective=0.1))]}, 0),
        ({"shapes": [Box(material=Material(transmissive=0.1))]}, GLASS),
        ({"shapes": [Box(material=Material(transmissive=0.1, reflective=0.5))]}, GLASS),
        ({"shapes": [Box(material=Material(diffuse=TEXTURE))]}, layout.TEXTURES | layout.TEXTURED_LOBES),
        ({"shapes": [Box(material=Material(ambient=TEXTURE))]}, layout.TEXTURES | layout.TEXTURED_LOBES),
        ({"shapes": [Sphere()]}, layout.QUADRICS),
        ({"shapes": [Sphere(material=GLOW)]}, layout.QUADRICS | layout.QUADRIC_LIGHTS | layout.ROUND_LIGHTS),
        ({"shapes": [Square(material=GLOW)]}, layout.TRIANGLE_LIGHTS),
        ({"shapes": [sphere_mesh(8)]}, 0),
        ({"shapes": [sphere_mesh(8, smooth=True)]}, layout.SMOOTH_NORMALS),
        ({"shapes": hidden("one-sided")}, layout.CULLING),
        ({"shapes": hidden("blend")}, layout.BLENDED_MATERIALS),
        ({"shapes": [sphere_mesh(8, material=GLOW)]}, layout.TRIANGLE_LIGHTS | layout.LIGHT_TREE),
        ({"shapes": [Box()], "environment": sky()}, layout.ENVIRONMENT),
        ({"shapes": [Box()], "environment": sky(0.0)}, 0),
        ({"shapes": [Box()], "lights": [PointLight(position=(0, 0, 9))]}, layout.POINT_LIGHTS),
        ({"shapes": [Box()], "lights": [PointLight(position=(0, 0, 9), colour=0.0)]}, 0),
        ({"shapes": [Box()], "lights": [DirectionalLight()]}, layout.DIRECTIONAL_LIGHTS),
    ],
    ids=str,
)
def test_a_scene_has_the_features_that_it_uses_and_no_others(scene, expected):
    assert features_of(pack_scene(Scene(**scene)).scene) == expected


def test_settings_have_the_features_that_they_use():
    def mask(camera=None, **settings):
        return settings_features(RenderSettings(**settings), camera or Camera())

    assert mask(rr_depth=None) == 0
    assert mask(rr_depth=4, max_depth=4) == 0
    assert mask(rr_depth=4, max_depth=5) == layout.ROULETTE
    assert mask(rr_depth=None, sampler="independent") == layout.INDEPENDENT_SAMPLER
    assert mask(rr_depth=None, hemisphere="uniform") == layout.UNIFORM_HEMISPHERE
    assert mask(rr_depth=None, fresnel="schlick") == layout.SCHLICK_FRESNEL
    assert mask(Camera(aperture=0.1), rr_depth=None) == layout.LENS
    assert mask(Camera(aperture=0.1), rr_depth=None, aperture=0.0) == 0
    assert mask(Camera(aperture=0.1, blades=6), rr_depth=None) == layout.LENS | layout.BLADES
    assert mask(Camera(aperture=0.1, blades=6), rr_depth=None, blades=0) == layout.LENS
    assert mask(Camera(blades=6), rr_depth=None, blades=5) == 0


@pytest.mark.parametrize(
    ("integrator", "bit"),
    [
        ("whitted", layout.WHITTED),
        ("albedo", layout.ALBEDO),
        ("normal", layout.NORMAL),
        ("depth", layout.DEPTH),
        ("ao", layout.OCCLUSION),
    ],
)
def test_an_integrator_other_than_path_has_its_bit_and_only_those_that_it_uses(integrator, bit):
    settings = RenderSettings(integrator=integrator, hemisphere="uniform", fresnel="schlick", sampler="independent")
    assert settings_features(settings, Camera()) == bit | layout.INDEPENDENT_SAMPLER
    assert settings_features(settings, Camera(aperture=0.1)) == bit | layout.INDEPENDENT_SAMPLER | layout.LENS
    assert bit & layout.PIXEL_INTEGRATORS


def test_phong_rows_hold_what_only_whitted_ray_tracing_reads():
    materials = [
        Material(ambient=(0.1, 0.2, 0.3), specular=0.5, shininess=20),
        Material(specular=0.5, reflective=(0.1, 0.2, 0.3), shininess=20),
        Material(specular=(0.4, 0.5, 0.6)),
        Material(specular=0.5, reflective=0.0),
        Material(ambient=TEXTURE),
    ]
    rows = pack_scene(Scene(shapes=[Box(material=material) for material in materials])).scene.phong
    assert rows.shape == (5, layout.PHONG_SIZE)
    ambient, highlight, mirror = (rows[:, k : k + 3] for k in (0, 4, 8))
    np.testing.assert_allclose(ambient, [(0.1, 0.2, 0.3), (0,) * 3, (0,) * 3, (0,) * 3, (0.5,) * 3])
    np.testing.assert_allclose(highlight, [(0.5,) * 3, (0.5,) * 3, (0,) * 3, (0,) * 3, (0,) * 3])
    np.testing.assert_allclose(mirror, [(0,) * 3, (0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (0,) * 3, (0,) * 3], rtol=1e-6)
    assert rows[:, 12].tolist() == [20, 20, 0, 0, 0]
    assert rows.view(np.int32)[:, 3].tolist() == [-1, -1, -1, -1, 0]


def test_point_and_directional_lights_are_counted_and_ambient_ones_added_up():
    scene = everything()
    scene.lights += [AmbientLight(colour=(1, 2, 3)), AmbientLight(colour=0.5), PointLight(position=(0, 0, 0), colour=0)]
    packed = pack_scene(scene).scene
    kinds = packed.lights.view(np.int32)[packed.first_delta :, 3][: packed.delta_count]
    assert kinds.tolist() == [layout.POINT_LIGHT, layout.DIRECTIONAL_LIGHT]
    assert packed.ambient.tolist() == [1.5, 2.5, 3.5, 0]
    dark = pack_scene(Scene(shapes=[Box()])).scene
    assert (dark.first_delta, dark.delta_count, dark.ambient.tolist()) == (0, 0, [0] * 4)
    assert dark.extent == pytest.approx(3**0.5)


def test_lights_of_every_kind_know_their_group():
    glow = Material(emission=1, group="glow")
    scene = Scene(
        shapes=[Box(material=glow), Sphere(material=glow), Sphere(material=Material(diffuse=1, group="dull"))],
        # Not in the order of the table.
        lights=[
            DirectionalLight(angle=1, group="glow"),
            SpotLight(position=(0, 9, 0), group="back"),
            PointLight(position=(0, 9, 0), group="key"),
            PointLight(position=(0, 9, 0), intensity=1, group="back"),
            DirectionalLight(),
            AmbientLight(),
            DirectionalLight(angle=2, group="glow"),
        ],
        environment=Sky(sun_angle=2, group="back"),
    )
    packed = pack_scene(scene).scene
    assert scene.light_groups == ("default", "back", "glow", "key")
    assert packed.group_count == 4
    numbers = packed.lights.view(np.int32)
    kinds, groups = numbers[:, 3], numbers[:, layout.LIGHT_GROUP]
    expected = {
        layout.TRIANGLE_LIGHT: 2,
        layout.QUADRIC_LIGHT: 2,
        layout.POINT_LIGHT: 3,
        layout.SPOT_LIGHT: 1,
        layout.DIRECTIONAL_LIGHT: 0,
        layout.ENVIRONMENT_LIGHT: 1,
    }
    assert {int(kind) for kind in kinds} == {int(kind) for kind in (*expected, layout.SUN_LIGHT)}
    for kind, group in expected.items():
        assert (groups[kinds == kind] == group).all()
    # The sky's own sun comes last.
    assert groups[kinds == layout.SUN_LIGHT].tolist() == [2, 2, 1]
    # The environment, what glows, and what does not.
    assert packed.light_groups.tolist() == [1, 2, 0]


def test_layers_of_the_film_are_named_in_the_order_of_their_columns():
    scene = Scene(lights=[PointLight(position=(0, 1, 0), group="key")])
    settings = RenderSettings(aov=("variance", "light_groups", "direct", "depth"))
    names = film_layers(settings, scene)
    assert names == ("emission", "direct", "indirect", "light_default", "light_key", "variance")
    assert settings_features(settings, Camera()) & layout.FILM_LAYERS == layout.FILM_LAYERS
    assert film_layers(RenderSettings(aov=("depth", "samples")), scene) == ()
    assert film_layers(RenderSettings(aov=("emission", "variance"), integrator="ao"), scene) == ("variance",)


@pytest.mark.parametrize("group", ["a.b", "key light", "ключ", 3])
def test_names_of_groups_are_names_of_channels(group):
    for make in (lambda: PointLight(position=(0, 0, 0), group=group), lambda: Material(group=group)):
        with pytest.raises(SceneError, match=r"group is .*: it must be a name of letters, digits, - and _"):
            make()


def test_a_normal_map_that_only_repeats_the_faces_is_not_smooth():
    flat = quad((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
    mesh = Mesh(vertices=flat.vertices, faces=flat.faces, normals=[(0, 0, -3)] * 4)
    assert mask_of(mesh) == 0


def everything():
    blue = Material(emission=(0, 0, 5.0))
    shapes = [
        Box(material=Material(diffuse=0.5)),
        Square(material=GLOW, transform=scaled(2, 3, 1)),
        sphere_mesh(4, material=blue, two_sided=False),
        Sphere(material=GLOW, transform=scaled(0.1, 5, 2)),
        Cone(material=blue),
        Cylinder(material=Material(specular=0.5)),
    ]
    lights = [PointLight(position=(0, 5, 0), colour=1e-6), DirectionalLight(colour=3.0)]
    return Scene(shapes=shapes, lights=lights, environment=sky(0.1))


def test_lights_are_drawn_with_probabilities_that_add_up_to_1_and_none_is_starved():
    packed = pack_scene(everything()).scene
    count = int(packed.light_count)
    rows = packed.lights
    threshold, probability = rows[:, 0].astype(float), rows[:, 2].astype(float)
    other, kind = rows.view(np.int32)[:, 1], rows.view(np.int32)[:, 3]
    assert np.bincount(kind, minlength=5).tolist() == [2 + 48, 2, 1, 1, 1]
    assert count == len(rows) == 55
    assert probability.sum() == pytest.approx(1, abs=1e-5)
    assert probability.min() >= 0.05 / count * 0.999
    share = threshold / count + np.bincount(other, (1 - threshold) / count, count)
    np.testing.assert_allclose(share, probability, atol=1e-6)
    assert packed.environment_probability == rows[kind == layout.ENVIRONMENT_LIGHT, 2]


def test_the_density_of_an_emitter_is_its_probability_over_its_area():
    packed = pack_scene(everything()).scene
    rows, numbers = packed.lights, packed.lights.view(np.int32)
    kind = numbers[:, 3]
    triangles = kind == layout.TRIANGLE_LIGHT
    area = np.linalg.norm(np.cross(rows[triangles, 8:11], rows[triangles, 12:15]), axis=1) / 2
    np.testing.assert_allclose(rows[triangles, 7] * area, rows[triangles, 2], rtol=1e-5)
    density = packed.emitter_density
    np.testing.assert_array_equal(density[numbers[triangles, 11]], rows[triangles, 7])
    quadrics = kind == layout.QUADRIC_LIGHT
    np.testing.assert_allclose(rows[quadrics, 19] * [4 * np.pi, np.pi * (np.sqrt(2) + 1)], rows[quadrics, 2], rtol=1e-5)
    np.testing.assert_array_equal(density[numbers[quadrics, 17]], rows[quadrics, 19])
    assert (density > 0).sum() == triangles.sum() + quadrics.sum()


def test_a_sphere_with_holes_is_drawn_by_its_area_since_its_far_side_is_seen():
    def packed(opacity):
        return pack_scene(Scene(shapes=[Sphere(material=Diffuse(emission=1, opacity=opacity))])).scene

    assert packed(1.0).features.mask & layout.ROUND_LIGHTS
    assert not packed(0.5).features.mask & layout.ROUND_LIGHTS
    # It says so itself, for scenes in which other spheres are round.
    assert (packed(1.0).quadrics[0, 13], packed(0.5).quadrics[0, 13]) == (1, 0)


def test_triangles_without_area_are_no_lights():
    mesh = Mesh(vertices=[(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0)], faces=[(0, 1, 2), (0, 1, 3)], material=GLOW)
    packed = pack_scene(Scene(shapes=[mesh])).scene
    assert packed.light_count == 1
    assert packed.emitter_density.tolist()[0] == 0
    assert np.isfinite(packed.lights[:, 4:]).all()


def test_equal_material_objects_share_a_record_and_textures_are_stored_once():
    shared = Material(diffuse=TEXTURE, specular=TEXTURE)
    packed = pack_scene(Scene(shapes=[Box(material=shared), Sphere(material=shared), Box(material=Material())])).scene
    assert packed.materials.shape == (2, layout.MATERIAL_SIZE)
    assert packed.textures.view(np.int32)[:, :3].tolist() == [[0, 3, 2]]
    # Six texels, and a coarser step of one.
    assert packed.texels.shape == (7, 4)
    assert (packed.primitives.view(np.int32)[:, 3] & layout.MATERIAL_MASK).tolist() == [0] * 12 + [1] * 12 + [0]


@pytest.mark.parametrize("kt", [(1.0, 1.0, 1.0), (0.5, 0.25, 1.0), (0.0, 0.5, 1.0)])
def test_transmission_becomes_extinction(kt):
    row = pack_scene(Scene(shapes=[Box(material=Material(transmissive=kt, index=1.5))])).scene.materials[0]
    at = int(layout.EXTINCTION)
    np.testing.assert_allclose(np.exp(-row[at : at + 3].astype(float)), kt, rtol=1e-6)
    assert row[at + 3] == 1
    assert row[layout.REFRACTION] == 1.5
    assert row[layout.REFRACTION + 1] == pytest.approx(np.mean(kt))


@pytest.mark.parametrize("shape", [Sphere, Cone, Cylinder], ids=lambda s: s.__name__)
@pytest.mark.parametrize("seed", range(4))
def test_the_box_around_a_quadric_holds_it_and_is_tight(shape, seed):
    rng = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3] = rng.normal(size=(3, 4))
    made = shape(transform=matrix)
    angle = np.linspace(0, 2 * np.pi, 721)[:, None]
    if isinstance(made, Sphere):
        theta = np.linspace(0, np.pi, 361)[None]
        points = np.stack(
            np.broadcast_arrays(np.sin(theta) * np.cos(angle), np.sin(theta) * np.sin(angle), np.cos(theta)), -1
        )
    else:
        z = np.array([[0, made.height]])
        r = np.array([[made.bottom_radius, made.top_radius]])
        points = np.stack(np.broadcast_arrays(r * np.cos(angle), r * np.sin(angle), z), -1)
    world = points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    lower, upper = quadric_box(made)
    assert (lower <= world.min(axis=0)).all()
    assert (upper >= world.max(axis=0)).all()
    size = world.max(axis=0) - world.min(axis=0)
    np.testing.assert_allclose(lower, world.min(axis=0), atol=1e-4 * size.max())
    np.testing.assert_allclose(upper, world.max(axis=0), atol=1e-4 * size.max())


def test_the_environment_frame_is_a_rotation_even_where_its_matrix_stretches():
    stretched = turned("y", 30) @ scaled(2, 3, 4)
    image = np.random.default_rng(1).random((4, 8, 3))
    frame = pack_scene(
        Scene(shapes=[Box()], environment=Environment(image=image, rotation=stretched))
    ).scene.environment_frame
    rows = frame.reshape(3, 4)[:, :3].astype(float)
    np.testing.assert_allclose(rows @ rows.T, np.eye(3), atol=1e-6)


def test_a_scene_without_shapes_warns_and_packs():
    with pytest.warns(LumipathWarning, match="no shapes"):
        packed = pack_scene(Scene(environment=sky())).scene
    assert packed.triangle_count == 0
    assert packed.light_count == 1


def test_a_packed_scene_survives_pickling_and_all_its_arrays_are_aligned():
    packed = pack_scene(everything()).scene
    copy = pickle.loads(pickle.dumps(packed))
    for name, a, b in zip(packed._fields, packed, copy):
        if isinstance(a, np.ndarray):
            assert a.ctypes.data % 64 == 0, name
            assert a.dtype.itemsize == 4, name
            np.testing.assert_array_equal(a.view(np.uint32), b.view(np.uint32))
        else:
            assert a == b
