"""Materials of several kinds at once: mixes of glass, overlapping media, holes and bent normals, in instances too."""

from __future__ import annotations

import numpy as np
import pytest
from judging import ALPHA, assert_same, p_value
from parts import floor, moved, quad, scaled, sky, turned, with_all_surfaces
from renders import renders

from lumipath.rendering.session import Session
from lumipath.scene import (
    Box,
    Camera,
    Conductor,
    Dielectric,
    Diffuse,
    DirectionalLight,
    Environment,
    Instance,
    Mesh,
    Mix,
    Principled,
    Scene,
    Sphere,
    Texture,
    ThinDielectric,
)

RNG = np.random.default_rng(8)
AHEAD = Camera(fov=45)
DOWN = Camera.look_at((0, 4, 0.001), (0, 0, 0), up=(0, 0, -1), fov=30)
FULL = Texture(np.ones((2, 2, 3)))
LEAF = Texture(np.concatenate([np.full((8, 8, 3), 0.5), RNG.random((8, 8, 1))], axis=2))


def pictures(*shapes, device, camera=AHEAD, environment=None, lights=(), **settings):
    """(seeds, H, W, 3): renders of a scene that shares its kernels with all others here."""
    scene = Scene(shapes=list(shapes), lights=list(lights), environment=environment, cameras=[camera])
    usual = {"width": 24, "height": 24, "spp": 64, "seeds": 12, "max_depth": 16}
    return renders(with_all_surfaces(scene), device=device, **(usual | settings))


def gradient():
    """A sky that is different everywhere."""
    row, column = np.meshgrid(np.arange(32) / 32, np.arange(64) / 64, indexing="ij")
    image = np.stack([row, column, 0.5 + 0.5 * np.sin(14 * column)], -1) + 0.1
    return Environment(image=image.astype(np.float32))


# ---- glass and water that overlap ------------------------------------------------------------------------------------

OF_GLASS = {"ior": 1.5, "attenuation_color": (0.5, 0.9, 0.6), "attenuation_distance": 0.5}
OF_WATER = {"ior": 1.33, "priority": 1, "attenuation_color": (0.5, 0.7, 0.9), "attenuation_distance": 0.8}
LEFT, RIGHT = moved(-0.3, 0.1, -3) @ scaled(0.8), moved(0.3, -0.1, -3) @ scaled(0.8)
AWAY = moved(0, -95, 0) @ scaled(0.01)


def placed(material, transform):
    """A ball as an instance of one that stands elsewhere too."""
    ball = Sphere(material=material)
    return [Instance(ball, transform=transform), Instance(ball, transform=AWAY)]


def alone(material, transform):
    return [Sphere(material=material, transform=transform)]


def twice(**options):
    """A mix of two materials that are the same."""
    return Mix(first=Dielectric(**OF_GLASS, priority=2), second=Dielectric(**OF_GLASS, priority=2), **options)


@pytest.fixture(scope="module")
def glass_in_water():
    shapes = alone(Dielectric(**OF_GLASS, priority=2), LEFT) + alone(Dielectric(**OF_WATER), RIGHT)
    return pictures(*shapes, device="cpu", environment=gradient(), first_seed=100)


@pytest.mark.parametrize(
    ("glass", "place"),
    [
        (lambda: twice(weight=0.3), alone),
        (lambda: Dielectric(**OF_GLASS, priority=2, opacity=FULL), alone),
        (lambda: Dielectric(**OF_GLASS, priority=2), placed),
        (lambda: twice(weight=FULL, opacity=FULL), placed),
    ],
    ids=["mix", "opaque", "instance", "all"],
)
def test_the_same_glass_made_otherwise_overlaps_in_the_same_way(device, glass, place, glass_in_water):
    shapes = place(glass(), LEFT) + place(Dielectric(**OF_WATER), RIGHT)
    assert_same(pictures(*shapes, device=device, environment=gradient()), glass_in_water)


def test_without_its_priority_the_glass_overlaps_in_another_way(device, glass_in_water):
    shapes = alone(Dielectric(**(OF_GLASS | {"ior": 1.5 / 1.33})), LEFT) + alone(Dielectric(**OF_WATER), RIGHT)
    assert p_value(pictures(*shapes, device=device, environment=gradient()), glass_in_water) < ALPHA


def test_a_ball_in_a_ball_of_the_same_glass_without_a_priority_is_there(device):
    # Its index is relative to what is around it, also where that is the very same material.
    glass, other = Dielectric(ior=1.5), Dielectric(ior=1.5)
    images = [
        pictures(*alone(glass, LEFT), *alone(inner, LEFT @ scaled(0.6)), device=device, environment=gradient(), seeds=6)
        for inner in (glass, other)
    ]
    single = pictures(*alone(glass, LEFT), device=device, environment=gradient(), seeds=6)
    assert_same(*images)
    assert p_value(images[0], single) < ALPHA


@pytest.mark.parametrize("priority", [None, 1])
def test_glass_that_is_partly_painted_lets_its_share_through_each_side(device, priority):
    # Of index 1, so that nothing is reflected: half of the light passes the front, half of that the back.
    ink = Dielectric(ior=1.0, priority=priority, attenuation_color=(0.5, 0.8, 0.2), attenuation_distance=0.4)
    painted = Mix(first=ink, second=Diffuse(reflectance=0.0), weight=0.5)
    slab = Box(transform=moved(0, 0, -2) @ scaled(8, 8, 0.4), material=painted)
    images = pictures(slab, device=device, environment=sky(), camera=Camera(fov=0.5), spp=256)
    assert_same(images, 0.25 * np.array([0.5, 0.8, 0.2]))


def test_a_pane_may_lie_within_glass_that_absorbs(device):
    # The pane has no inside: before and behind it there is the same glass.
    ink = Dielectric(ior=1.0, priority=1, attenuation_color=(0.5, 0.8, 0.2), attenuation_distance=0.4)
    slab = Box(transform=moved(0, 0, -2) @ scaled(8, 8, 0.4), material=ink)
    pane = quad((-4, -4, -2.1), (4, -4, -2.1), (4, 4, -2.1), (-4, 4, -2.1), material=ThinDielectric(ior=1.0))
    images = pictures(slab, pane, device=device, environment=sky(), camera=Camera(fov=0.5), seeds=4)
    # Nothing is left to chance; rays start a little off each surface.
    np.testing.assert_allclose(images, np.broadcast_to((0.5, 0.8, 0.2), images.shape), rtol=1e-3)


# ---- holes within instances ------------------------------------------------------------------------------------------

LEAVES = Diffuse(reflectance=(0.2, 0.6, 0.1), opacity=LEAF.view("a"))
PLACES = moved(0, 0.5, 0) @ turned("y", 30) @ turned("x", 20), moved(0.3, 0.9, 0.2) @ turned("z", -25)


def sheet(transform=None, **options):
    """A square with texture coordinates, and colours that are half transparent at its corners."""
    corners = np.array([(-0.7, 0, 0.7), (0.7, 0, 0.7), (0.7, 0, -0.7), (-0.7, 0, -0.7)])
    if transform is not None:
        corners = corners @ transform[:3, :3].T + transform[:3, 3]
    return quad(*corners, uv=True, **options)


CLEAR = np.array([(1.0, 1.0, 1.0, 0.2)] * 4)


@pytest.mark.parametrize(
    ("part", "material"),
    [
        (sheet(material=LEAVES), None),
        (sheet(material=Diffuse(reflectance=0.9)), LEAVES),
        # Colours of vertices belong to the material of the mesh.
        (sheet(material=Diffuse(reflectance=0.9), colours=CLEAR), LEAVES),
    ],
    ids=["own", "of the instance", "instead of vertex colours"],
)
def test_leaves_that_are_instances_throw_the_shadows_of_leaves(device, part, material):
    ground = floor(2, material=Diffuse(reflectance=0.8))
    sun = DirectionalLight(direction=(0.3, -1, 0.2), colour=(2.0, 1.8, 1.5))
    settings = {"device": device, "camera": DOWN, "environment": sky(0.4), "lights": [sun], "max_depth": 3, "seeds": 8}
    copies = [sheet(transform=place, material=LEAVES) for place in PLACES]
    instances = [Instance(part, transform=place, material=material) for place in PLACES]
    usual = pictures(ground, *copies, first_seed=100, **settings)
    assert_same(pictures(ground, *instances, **settings), usual)
    closed = [sheet(transform=place, material=Diffuse(reflectance=(0.2, 0.6, 0.1))) for place in PLACES]
    assert p_value(pictures(ground, *closed, **settings), usual) < ALPHA


def test_an_instance_of_a_mix_shines_as_its_own_material_says(device):
    # The mesh's own material would shine; the one that the instances have does not.
    lamp = sheet(material=Diffuse(emission=5.0))
    dull = Mix(first=Diffuse(reflectance=0.5), second=Diffuse(reflectance=0.5))
    shapes = [Instance(lamp, transform=place, material=dull) for place in PLACES]
    assert pictures(*shapes, device=device, camera=DOWN, max_depth=1, seeds=2).max() < 1e-3


# ---- maps, colours and kinds -----------------------------------------------------------------------------------------


def big_sheet(**options):
    corners = ((-3, 0, 3), (3, 0, 3), (3, 0, -3), (-3, 0, -3))
    uvs = ((0, 0), (1, 0), (1, 1), (0, 1))
    return Mesh(vertices=corners, faces=[(0, 1, 2), (0, 2, 3)], uvs=uvs, **options)


def test_a_bent_normal_turns_an_anisotropic_highlight_as_a_bent_surface_does(device):
    brushed = {"metallic": 1.0, "roughness": 0.5, "anisotropy": 0.8, "anisotropy_rotation": 30.0, "clearcoat": 0.5}
    normal = np.array([np.sin(0.3), 0.2, np.cos(0.3)]) / np.linalg.norm([np.sin(0.3), 0.2, np.cos(0.3)])
    bent = Texture(np.broadcast_to((normal + 1) / 2, (2, 2, 3)))
    # u runs along x and v along -z.
    normals = np.broadcast_to((normal[0], normal[2], -normal[1]), (4, 3))
    shapes = [
        big_sheet(material=Principled(**brushed, normal_map=bent)),
        big_sheet(material=Principled(**brushed), normals=normals),
        big_sheet(material=Principled(**brushed)),
    ]
    sun = DirectionalLight(direction=(-0.4, -1, 0.3), colour=2.0)
    settings = {"device": device, "camera": DOWN, "lights": [sun], "max_depth": 1, "seeds": 1}
    mapped, smooth, flat = (pictures(shape, **settings)[0] for shape in shapes)
    assert mapped.max() > 0.1
    np.testing.assert_allclose(mapped, smooth, rtol=2e-3, atol=1e-4)
    assert np.abs(mapped / flat - 1).max() > 0.3


@pytest.mark.parametrize(
    "options",
    [{"metallic": 0.0}, {"metallic": 1.0}, {"transmission": 1.0, "thin": True}],
    ids=["matt", "metal", "thin"],
)
def test_colours_of_vertices_multiply_the_base_colour(device, options):
    tint = np.array((0.2, 0.5, 1.0))
    coloured = big_sheet(material=Principled(base_color=0.8, **options), colours=np.array([tint] * 4))
    painted = big_sheet(material=Principled(base_color=0.8 * tint, **options))
    settings = {"device": device, "camera": DOWN, "environment": gradient(), "max_depth": 2, "seeds": 1}
    np.testing.assert_allclose(pictures(coloured, **settings), pictures(painted, **settings), rtol=1e-4)


def test_a_part_of_a_mix_is_drawn_on_a_mesh_beside_blended_materials(device):
    # Sums of lobes may be blended between vertices; a mix is not.
    red, blue = Diffuse(reflectance=(0.8, 0, 0)), Diffuse(reflectance=(0, 0, 0.8))
    mixed = big_sheet(material=Mix(first=red, second=blue, weight=0.25))
    images = pictures(mixed, device=device, camera=DOWN, environment=sky(), max_depth=1)
    assert_same(images, (0.6, 0, 0.2))


# ---- looks and layers ------------------------------------------------------------------------------------------------

WALL = (0.2, 0.4, 0.6)
GOLD = Conductor(metal="gold", roughness=0.8)
BALANCED = Mix(first=Diffuse(reflectance=0.2), second=Diffuse(reflectance=0.8), weight=0.5)
GLOWING = Mix(first=Diffuse(reflectance=0.0), second=GOLD, weight=0.0, emission=2.0, group="sign")
# Each with the albedo of the layer, for which smooth glass is looked through.
PANELS = [
    (ThinDielectric(), WALL),
    (Principled(base_color=1.0, transmission=1.0, roughness=0.0, thin=True), WALL),
    (Principled(base_color=1.0, transmission=0.6, roughness=0.0, ior=1.0), WALL),
    (Principled(base_color=0.8, transmission=0.3, roughness=0.0), 0.8),
    (Dielectric(roughness=0.6), 1.0),
    (GOLD, GOLD.face_on()),
    (Principled(base_color=(0.9, 0.2, 0.1), metallic=1.0, roughness=0.8), (0.9, 0.2, 0.1)),
    (BALANCED, 0.5),
    (GLOWING, 0.0),
    (Diffuse(reflectance=0.9, opacity=0.0), WALL),
]
IN_FRONT = {"width": 5 * len(PANELS), "height": 5, "spp": 64, "max_depth": 4}


def panels(change=lambda material: material):
    """A wall and squares before it, side by side, each 5 pixels wide."""
    shapes = [quad((-90, -90, -9), (90, -90, -9), (90, 90, -9), (-90, 90, -9), material=Diffuse(reflectance=WALL))]
    for k, (material, _) in enumerate(PANELS):
        x = k - (len(PANELS) - 1) / 2
        corners = ((x - 0.5, -1, -4), (x + 0.5, -1, -4), (x + 0.5, 1, -4), (x - 0.5, 1, -4))
        shapes.append(quad(*corners, material=change(material)))
    camera = Camera(fov=float(np.degrees(2 * np.arctan(0.5 / 4))))
    lights = [DirectionalLight(direction=(0.1, -0.2, -1), colour=1.0, group="sun")]
    return Scene(shapes=shapes, lights=lights, environment=sky(0.3), cameras=[camera])


def test_layers_see_smooth_glass_through_and_rough_glass_itself_and_add_up(device):
    parts = ("emission", "direct", "indirect")
    session = Session(panels(), device=device, aov=("albedo", "normal", "light_groups", *parts), **IN_FRONT)
    image = session.run()
    for k, (_, albedo) in enumerate(PANELS):
        middle = 2, 5 * k + 2
        seen = image["albedo"][middle]
        # Of a mix of two albedos, as 64 samples draw them.
        tolerance = 0.15 if isinstance(PANELS[k][0], Mix) else 1e-3
        np.testing.assert_allclose(seen, np.broadcast_to(albedo, 3), atol=tolerance, err_msg=str(k))
        np.testing.assert_allclose(image["normal"][middle], (0, 0, 1), atol=1e-3)
    whole = np.asarray(image, np.float64)
    np.testing.assert_allclose(sum(image[name] for name in parts), whole, rtol=1e-4, atol=1e-5)
    groups = ("light_default", "light_sign", "light_sun")
    np.testing.assert_allclose(sum(image[name] for name in groups), whole, rtol=1e-4, atol=1e-5)
    # A mix shines as a whole, whichever of its parts a ray meets.
    sign = 5 * [material for material, _ in PANELS].index(GLOWING) + 2
    np.testing.assert_allclose(image["emission"][2, sign], 2.0, rtol=1e-5)
    np.testing.assert_allclose(image["light_sign"][2, sign], 2.0, rtol=1e-5)
    assert image["light_sign"][2, 2].max() > 0


def test_whitted_ray_tracing_sees_the_lobes_that_stand_for_a_material(device):
    ours, lobes = (
        np.asarray(Session(scene, device=device, integrator="whitted", **IN_FRONT).run(), np.float64)
        for scene in (panels(), panels(lambda m: m if isinstance(m, Mix) or m.has_holes else m.as_lobes()))
    )
    np.testing.assert_allclose(ours, lobes, rtol=1e-4, atol=1e-6)
    middles = ours[2, 2::5].max(axis=1)
    assert (middles > 0).all()
