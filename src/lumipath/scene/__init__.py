"""What a scene is, in world units, validated; knows nothing of files or rendering."""

from .bsdfs import Appearance, Conductor, Dielectric, Diffuse, ThinDielectric
from .camera import Camera
from .digest import scene_digest
from .lights import AmbientLight, DirectionalLight, Environment, Light, PointLight
from .material import Material, Texture
from .principled import Principled
from .scene import Scene
from .shapes import Box, Cone, Cylinder, Mesh, Shape, Sphere, Square, smooth_normals, transform_mesh

__all__ = [
    "AmbientLight",
    "Appearance",
    "Box",
    "Camera",
    "Conductor",
    "Cone",
    "Cylinder",
    "Dielectric",
    "Diffuse",
    "DirectionalLight",
    "Environment",
    "Light",
    "Material",
    "Mesh",
    "PointLight",
    "Principled",
    "Scene",
    "Shape",
    "Sphere",
    "Square",
    "Texture",
    "ThinDielectric",
    "scene_digest",
    "smooth_normals",
    "transform_mesh",
]
