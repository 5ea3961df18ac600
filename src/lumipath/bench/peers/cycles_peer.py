"""Cycles, Blender's renderer, as the package bpy: a script for `serve`."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

from serve import meshes, serve


def make(arrays: Any, options: list[str]) -> tuple[str, Any]:
    """The renderer of one scene."""
    import bpy
    import numpy as np
    from mathutils import Matrix

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    _set_up(scene, arrays)
    for k, (vertices, faces, albedo, emission) in enumerate(meshes(arrays)):
        mesh = bpy.data.meshes.new(f"mesh {k}")
        mesh.from_pydata(vertices.tolist(), [], faces.tolist())
        mesh.materials.append(_material(bpy, albedo, emission))
        scene.collection.objects.link(bpy.data.objects.new(mesh.name, mesh))
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.angle = "VERTICAL", math.radians(float(arrays["fov"]))
    seen = bpy.data.objects.new("camera", camera)
    position, right, up, backward = arrays["camera"].tolist()
    columns = [[*axis, 0.0] for axis in (right, up, backward)] + [[*position, 1.0]]
    seen.matrix_world = Matrix(columns).transposed()
    scene.collection.objects.link(seen)
    scene.camera = seen
    scene.render.filepath = str(Path(arrays.fid.name).with_name("cycles.exr"))

    def whole(spp: int, seed: int) -> float:
        scene.cycles.samples, scene.cycles.seed = spp, seed
        # Without it a render that keeps its data may not notice.
        scene.update_tag()
        bpy.context.view_layer.update()
        start = time.perf_counter()
        bpy.ops.render.render(write_still=True)
        return time.perf_counter() - start

    # Blender hands the scene over and writes the file each time, which is no rendering: its time is subtracted.
    whole(1, 0)
    one = min(whole(1, 0) for _ in range(3))
    five = min(whole(5, 0) for _ in range(3))
    apart = max(0.0, one - (five - one) / 4)

    def render(spp: int, seed: int) -> tuple[Any, float]:
        seconds = max(whole(spp, seed) - apart, 1e-6)
        image = bpy.data.images.load(scene.render.filepath, check_existing=False)
        width, height = image.size
        pixels = np.empty(width * height * 4, np.float32)
        image.pixels.foreach_get(pixels)
        bpy.data.images.remove(image)
        return pixels.reshape(height, width, 4)[::-1, :, :3], seconds

    return f"Cycles (Blender {bpy.app.version_string})", render


def _set_up(scene: Any, arrays: Any) -> None:
    """A plain path tracer: no adaptive sampling, no denoiser, no clamping, no light from nowhere, linear output."""
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.light_sampling_threshold = 0.0
    # The last surface asks for the light of the lamps, which is no bounce to Cycles.
    cycles.max_bounces = cycles.diffuse_bounces = max(int(arrays["max_depth"]) - 1, 0)
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    render = scene.render
    render.resolution_x, render.resolution_y = (int(side) for side in arrays["size"])
    render.resolution_percentage = 100
    render.use_persistent_data = True
    if int(arrays["threads"]):
        render.threads_mode, render.threads = "FIXED", int(arrays["threads"])
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    scene.view_settings.view_transform = "Raw"


def _material(bpy: Any, albedo: Any, emission: Any) -> Any:
    """Matt, and emitting from the front only."""
    material = bpy.data.materials.new("material")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    output = nodes.new("ShaderNodeOutputMaterial")
    matt = nodes.new("ShaderNodeBsdfDiffuse")
    matt.inputs["Color"].default_value = (*albedo.tolist(), 1.0)
    last = matt.outputs[0]
    if emission.max() > 0:
        strength = float(emission.max())
        lamp = nodes.new("ShaderNodeEmission")
        lamp.inputs["Color"].default_value = (*(emission / strength).tolist(), 1.0)
        side, switch = nodes.new("ShaderNodeNewGeometry"), nodes.new("ShaderNodeMath")
        switch.operation = "MULTIPLY_ADD"
        switch.inputs[1].default_value, switch.inputs[2].default_value = -strength, strength
        links.new(side.outputs["Backfacing"], switch.inputs[0])
        links.new(switch.outputs[0], lamp.inputs["Strength"])
        both = nodes.new("ShaderNodeAddShader")
        links.new(last, both.inputs[0])
        links.new(lamp.outputs[0], both.inputs[1])
        last = both.outputs[0]
    links.new(last, output.inputs["Surface"])
    return material


if __name__ == "__main__":
    serve(make)
