"""CUDA kernels on any machine: they compile for every generation of GPUs, within bounds, and on no double precision."""

import re
import sys

import numpy as np
import pytest

pytest.importorskip("numba_cuda", reason="needs the extra 'cuda'")

from numba import typeof, types

from lumipath import builtin
from lumipath.accel.bvh4 import MAX_LEAF, gpu_tree
from lumipath.accel.two_level import build_trees
from lumipath.devices.cuda.arguments import FILM_TYPE, VIEW_TYPE, type_of
from lumipath.devices.cuda.layers import compile_layers
from lumipath.devices.cuda.schedulers import (
    compile_megakernel,
    compile_paths,
    compile_pixels,
    compile_wavefront,
    compiler_of,
)
from lumipath.devices.cuda.wavefront import TRACING
from lumipath.lang import Features, cuda
from lumipath.pack.layout import WIDE_TREE, PackedScene
from lumipath.pack.scene import layer_features, pack_scene, settings_features
from lumipath.scene import (
    Conductor,
    Dielectric,
    Diffuse,
    DirectionalLight,
    Instance,
    Mesh,
    Mix,
    PointLight,
    Principled,
    Scene,
    Sphere,
    SpotLight,
    Texture,
    ThinDielectric,
)
from lumipath.scenes.forest import forest
from lumipath.settings import RenderSettings

STACK, DEEP_STACK = 64, 256
# Turing, Ampere, Hopper, Blackwell.
CAPABILITIES = [(7, 5), (8, 0), (9, 0), (12, 0)]
ENDS = [CAPABILITIES[0], CAPABILITIES[-1]]


@pytest.fixture(autouse=True, scope="module")
def single_precision(tmp_path_factory):
    """Whatever is compiled here computes in single precision and calls only its own; nothing is taken from the disk."""
    folder, compile_ptx = tmp_path_factory.mktemp("kernels"), cuda.compile_ptx

    def checked(*arguments):
        ptx = compile_ptx(*arguments)
        body = ptx[ptx.index(".entry") :]
        assert re.search(r"\.f32\s", body)
        assert not re.search(r"\.f64\s", body)
        # The one look-up of textures may stay a function; libraries have none that is needed.
        called = re.findall(r"\bcall(?:\.uni)?\s+(?:\([^)]*\),\s*)?(\w+)", body)
        assert len(called) == len(re.findall(r"\bcall(?:\.uni)?\b", body))
        assert all("looked_up" in name for name in called)
        assert ".extern .func" not in ptx
        return ptx

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cuda, "compile_ptx", checked)
        patch.setattr(cuda, "cache_folder", lambda: folder)
        yield


def arguments(name, *, wide, lights=(), **settings):
    """Argument types of the kernels for a scene, or a built-in one, with further lights."""
    scene = builtin(name) if isinstance(name, str) else name
    scene.lights += lights
    packed = pack_scene(scene, light_sampling=settings.get("light_sampling", "auto"))
    geometry = packed.geometry
    trees = build_trees(*geometry.bounds(), geometry.instancing, max_leaf=MAX_LEAF, block=1)
    sides, solid = geometry.two_sided, geometry.solid()
    accel, roots, depth = gpu_tree(trees, geometry.vertices, geometry.faces, sides, solid, wide=wide)
    assert depth <= DEEP_STACK
    mask = packed.scene.features.mask | settings_features(RenderSettings(**settings), scene.camera(None))
    features = Features(mask | (WIDE_TREE if wide else 0))
    return type_of(packed.with_tree(accel, roots)._replace(features=features)), VIEW_TYPE, FILM_TYPE


def resources(report):
    """Registers and bytes of stack, from the assembler's report."""
    registers, stack = re.findall(r"used (\d+) registers.*?(\d+) stack", report)[-1]
    return int(registers), int(stack)


def code_size(cubin):
    """Bytes of instructions in an ELF file of 64 bits: what its executable sections hold."""
    start = int.from_bytes(cubin[40:48], "little")
    size, count = int.from_bytes(cubin[58:60], "little"), int.from_bytes(cubin[60:62], "little")
    headers = [cubin[start + k * size : start + (k + 1) * size] for k in range(count)]
    # SHF_EXECINSTR is 4.
    return sum(int.from_bytes(header[32:40], "little") for header in headers if header[8] & 4)


@pytest.mark.parametrize("capability", CAPABILITIES, ids=lambda c: f"sm_{c[0]}{c[1]}")
def test_the_megakernel_compiles_within_its_registers_and_hardly_spills(capability):
    made = compile_megakernel(arguments("bench-cornell", wide=True), capability, STACK)
    registers, stack = resources(made.report)
    assert registers <= 56
    # The traversal stack itself, and what does not fit into the registers.
    assert 4 * STACK <= stack <= 4 * STACK + 96


def test_the_megakernel_for_tiny_scenes_does_not_spill():
    made = compile_megakernel(arguments("bench-cornell", wide=False), (9, 0), STACK)
    assert resources(made.report) == (64, 4 * STACK)


@pytest.mark.parametrize("wide", [False, True], ids=["binary", "wide"])
def test_squares_and_goals_cost_no_registers(wide):
    adaptive = compile_megakernel(arguments("bench-cornell", wide=wide, noise=0.1), (9, 0), STACK)
    usual = compile_megakernel(arguments("bench-cornell", wide=wide), (9, 0), STACK)
    assert adaptive.cubin != usual.cubin
    assert resources(adaptive.report)[0] <= resources(usual.report)[0]
    assert resources(adaptive.report)[1] <= 4 * STACK + 96


def test_all_materials_and_primitives_compile_within_bounds():
    made = compile_megakernel(arguments("primitives", wide=True), (9, 0), STACK)
    registers, stack = resources(made.report)
    assert registers <= 64
    assert stack <= 4 * STACK + 128


def test_textured_principled_surfaces_below_a_sky_compile_within_bounds():
    made = compile_megakernel(arguments("bench-materials-cornell", wide=True), (9, 0), STACK)
    registers, stack = resources(made.report)
    assert registers <= 64
    # Calls of the look-up of textures save registers there.
    assert stack <= 4 * STACK + 256
    # What a GPU can keep of its instructions near (decision 0008).
    assert code_size(made.cubin) < 96 * 1024


@pytest.mark.parametrize("wide", [False, True], ids=["binary", "wide"])
def test_instances_compile_within_bounds(wide, monkeypatch):
    monkeypatch.setattr(sys.modules[__name__], "builtin", lambda name: forest(trees=4, twigs=1))
    signature = arguments("forest", wide=wide)
    registers, stack = resources(compile_megakernel(signature, (9, 0), STACK).report)
    assert registers <= 64
    assert stack <= 4 * STACK + 96
    for name, made in compile_wavefront(signature, (9, 0), STACK).items() if wide else ():
        registers, stack = resources(made.report)
        assert registers <= (96 if name == "shade" else 64), name
        assert stack == (4 * STACK if name in TRACING else 0), name


@pytest.mark.parametrize("wide", [False, True], ids=["binary", "wide"])
def test_the_stages_of_the_wavefront_compile_within_bounds(wide):
    for name, made in compile_wavefront(arguments("bench-cornell", wide=wide), (9, 0), STACK).items():
        registers, stack = resources(made.report)
        assert registers <= (96 if name == "shade" else 64), name
        # Only traversal has a stack; nothing spills.
        assert stack == (4 * STACK if name in TRACING else 0), name


@pytest.mark.parametrize("capability", ENDS, ids=lambda c: f"sm_{c[0]}{c[1]}")
def test_the_stages_of_the_wavefront_compile_with_materials_within_bounds(capability):
    signature = arguments("bench-materials-cornell", wide=capability == ENDS[0])
    for name, made in compile_wavefront(signature, capability, STACK).items():
        registers, stack = resources(made.report)
        assert registers <= (96 if name == "shade" else 64), name
        # What does not fit into the registers, and calls of the look-up of textures.
        assert stack <= (4 * STACK if name in TRACING else 128), name


CAMERAS = [
    ("orthographic", "gaussian"),
    ("panorama", "mitchell"),
    ("fisheye", "box"),
    ("fisheye-equisolid", "mitchell"),
]


@pytest.mark.parametrize(("projection", "name"), CAMERAS)
def test_cameras_and_filters_compile_within_bounds(projection, name):
    settings = {"projection": projection, "filter": name, "aperture": 0.1, "blades": 6}
    made = compile_megakernel(arguments("bench-cornell", wide=True, **settings), (9, 0), STACK)
    registers, stack = resources(made.report)
    assert registers <= 56
    assert stack <= 4 * STACK + 160


@pytest.mark.parametrize(("camera", "integrator"), [*zip(CAMERAS, ["whitted", "depth"] * 2, strict=True)])
def test_cameras_and_filters_of_other_integrators_compile(camera, integrator):
    settings = {"projection": camera[0], "filter": camera[1], "aperture": 0.1, "integrator": integrator}
    compile_pixels(arguments("bench-cornell", wide=True, **settings), (9, 0), STACK)


def test_a_plain_camera_costs_what_it_did():
    # Bits of other cameras and filters change the code; without them there is no trace of it.
    plain = compile_megakernel(arguments("bench-cornell", wide=True), (9, 0), STACK)
    named = arguments("bench-cornell", wide=True, projection="perspective", filter="box", filter_radius=0.5)
    assert compile_megakernel(named, (9, 0), STACK).cubin == plain.cubin
    assert (
        compile_megakernel(arguments("bench-cornell", wide=True, filter="gaussian"), (9, 0), STACK).cubin != plain.cubin
    )


def test_the_wavefront_compiles_with_signed_samples_within_bounds():
    signature = arguments("bench-cornell", wide=True, filter="mitchell", projection="fisheye")
    for name, made in compile_wavefront(signature, (9, 0), STACK).items():
        registers, stack = resources(made.report)
        assert registers <= (96 if name == "shade" else 64), name
        assert stack == (4 * STACK if name in TRACING else 0), name


LOOKS = ("albedo", "normal", "depth", "ao")
LIGHTS = [PointLight(position=(0, 1, 0)), DirectionalLight()]


EVERY_LIGHT = [*LIGHTS, SpotLight(position=(0, 1, 0)), DirectionalLight(angle=1)]


@pytest.mark.parametrize("integrator", LOOKS)
def test_quick_looks_compile_within_bounds_and_spill_nothing(integrator):
    signature = arguments("primitives", wide=True, integrator=integrator)
    registers, stack = resources(compile_pixels(signature, (9, 0), STACK).report)
    assert registers <= 80
    assert stack == 4 * STACK


@pytest.mark.parametrize("capability", ENDS, ids=lambda c: f"sm_{c[0]}{c[1]}")
def test_whitted_ray_tracing_compiles_within_bounds(capability):
    signature = arguments("glass", wide=True, lights=EVERY_LIGHT, integrator="whitted")
    registers, stack = resources(compile_pixels(signature, capability, STACK).report)
    assert registers <= 168
    # One traversal stack for rays of both kinds, and 32 waiting rays of 11 numbers.
    assert stack == 4 * STACK + 32 * 11 * 4


def test_adaptive_looks_compile():
    compile_pixels(arguments("primitives", wide=True, noise=0.1, integrator="ao"), (9, 0), STACK)


@pytest.mark.parametrize(
    ("integrator", "wide"), [("albedo", True), ("normal", False), ("depth", True), ("ao", False), ("whitted", False)]
)
def test_integrators_of_textured_scenes_compile(integrator, wide):
    signature = arguments("textures", wide=wide, lights=LIGHTS, integrator=integrator, aperture=0.1)
    compile_pixels(signature, (9, 0), STACK)


EVERY_LAYER = ("emission", "direct", "indirect", "light_groups", "variance")


def test_layers_of_light_have_a_kernel_of_their_own_and_others_the_megakernel():
    def mask(**settings):
        return arguments("bench-cornell", wide=True, **settings)[0].types[0].mask

    assert compiler_of(mask()) is compiler_of(mask(aov=("albedo", "samples"))) is compile_megakernel
    assert all(compiler_of(mask(aov=(name,))) is compile_paths for name in EVERY_LAYER)
    assert compiler_of(mask(aov=("variance",), integrator="ao")) is compile_pixels


@pytest.mark.parametrize("capability", ENDS, ids=lambda c: f"sm_{c[0]}{c[1]}")
def test_layers_of_light_compile_within_bounds(capability):
    signature = arguments("primitives", wide=True, lights=EVERY_LIGHT, aov=EVERY_LAYER, noise=0.1)
    registers, stack = resources(compile_paths(signature, capability, STACK).report)
    assert registers <= 168
    assert stack == 4 * STACK


@pytest.mark.parametrize("aov", [("light_groups",), ("variance",)], ids=lambda aov: aov[0])
def test_some_layers_of_light_compile(aov):
    compile_paths(arguments("textures", wide=False, lights=EVERY_LIGHT, aov=aov), (9, 0), STACK)


def layers_scene(name, *, wide, **settings):
    """The type of a built-in scene for the pass that fills layers."""
    scene_type, _, _ = arguments(name, wide=wide)
    mask = layer_features(scene_type.types[0].mask, RenderSettings(**settings), builtin(name).camera(None))
    return types.NamedTuple((typeof(Features(mask)), *scene_type.types[1:]), PackedScene)


@pytest.mark.parametrize("capability", ENDS, ids=lambda c: f"sm_{c[0]}{c[1]}")
def test_layers_compile_within_bounds_and_spill_nothing(capability):
    made = compile_layers(layers_scene("primitives", wide=True, aperture=0.1), capability, STACK)
    registers, stack = resources(made.report)
    assert registers <= 128
    assert stack == 4 * STACK


@pytest.mark.parametrize(
    ("scene", "wide"), [("bench-materials-cornell", True), ("many-lobes", True), ("textures", False)]
)
def test_layers_of_all_surfaces_compile(scene, wide):
    compile_layers(layers_scene(scene, wide=wide, sampler="independent"), (9, 0), STACK)


def test_kernels_for_another_stack_are_other_kernels():
    signature = arguments("bench-cornell", wide=True, integrator="depth")
    _, shallow = resources(compile_pixels(signature, (9, 0), STACK).report)
    _, deep = resources(compile_pixels(signature, (9, 0), 4 * STACK).report)
    assert deep - shallow == 4 * 3 * STACK


@pytest.mark.parametrize("light_sampling", ["tree", "power"])
def test_lights_of_every_kind_compile_within_bounds(light_sampling):
    made = compile_megakernel(
        arguments("many-lamps", wide=True, lights=EVERY_LIGHT, light_sampling=light_sampling), (9, 0), STACK
    )
    registers, stack = resources(made.report)
    assert registers <= 64
    assert stack <= 4 * STACK + 256


@pytest.mark.parametrize("sampler", ["blue-noise", "independent"])
def test_samplers_compile_within_bounds(sampler):
    made = compile_megakernel(arguments("bench-cornell", wide=True, sampler=sampler), (9, 0), STACK)
    registers, stack = resources(made.report)
    assert registers <= 56
    assert stack <= 4 * STACK + 96


def test_textured_scenes_compile():
    compile_megakernel(arguments("textures", wide=True), (9, 0), STACK)


def every_surface():
    """All materials and all that they may have, media with priorities, textures of both widths, and instances."""
    data = Texture(np.full((4, 4, 4), 128, np.uint8), srgb=False)
    metal = Conductor(roughness=data.view("g"), anisotropy=0.5, normal_map=data)
    mix = Mix(first=metal, second=Diffuse(roughness=1.0, bump_map=data), weight=data, opacity=data.view("a"))
    lamp = Diffuse(emission=Texture(np.ones((2, 2, 3))), opacity=0.5, two_sided=False)
    mesh = {"vertices": np.eye(3), "faces": [(0, 1, 2)], "uvs": np.eye(3, 2)}
    coloured = Mesh(**mesh, material=mix, colours=np.ones((3, 4)), normals=np.eye(3) + 0.1)
    principled = Principled(
        transmission=0.5, clearcoat=1.0, sheen_color=0.5, iridescence=1.0, specular=0.5, anisotropy=0.5, roughness=data
    )
    glass = Dielectric(roughness=0.5, priority=1)
    shapes = [coloured, Mesh(**mesh, material=lamp), Sphere(material=mix), Sphere(material=lamp)]
    round_lamp = Diffuse(emission=1.0)
    shapes += [Sphere(material=material) for material in (principled, glass, ThinDielectric(), round_lamp)]
    return Scene(shapes=[*shapes, *(Instance(coloured, transform=np.diag([s, s, s, 1])) for s in (1.0, 2.0))])


def test_kernels_of_all_surfaces_and_lights_compile():
    settings = {"light_sampling": "tree", "clamp_indirect": 1.0, "regularize": True}
    compile_megakernel(arguments(every_surface(), wide=True, lights=EVERY_LIGHT, **settings), (9, 0), STACK)
