"""What a scene is, in world units, validated; knows nothing of files or rendering."""

from .bsdfs import AnyMaterial, Appearance, Conductor, Dielectric, Diffuse, ThinDielectric
from .camera import Camera
from .deforming import deformed_meshes, with_meshes
from .digest import scene_digest
from .instances import Group, Instance, materials_of
from .lights import AmbientLight, DirectionalLight, Environment, Light, PointLight, SpotLight
from .material import Material
from .mix import Mix
from .principled import Principled
from .scene import Scene
from .shapes import Box, Cone, Cylinder, Mesh, Shape, Sphere, Square, smooth_normals, transform_mesh
from .sky import Sky
from .textures import Checker, Texture

__all__ = [
    "AmbientLight",
    "AnyMaterial",
    "Appearance",
    "Box",
    "Camera",
    "Checker",
    "Conductor",
    "Cone",
    "Cylinder",
    "Dielectric",
    "Diffuse",
    "DirectionalLight",
    "Environment",
    "Group",
    "Instance",
    "Light",
    "Material",
    "Mesh",
    "Mix",
    "PointLight",
    "Principled",
    "Scene",
    "Shape",
    "Sky",
    "Sphere",
    "SpotLight",
    "Square",
    "Texture",
    "ThinDielectric",
    "deformed_meshes",
    "materials_of",
    "scene_digest",
    "smooth_normals",
    "transform_mesh",
    "with_meshes",
]
