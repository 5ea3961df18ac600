"""What a scene is, in world units, validated; knows nothing of files or rendering."""

from .camera import Camera
from .digest import scene_digest
from .lights import AmbientLight, DirectionalLight, Environment, Light, PointLight, SpotLight
from .material import Material, Texture
from .scene import Scene
from .shapes import Box, Cone, Cylinder, Mesh, Shape, Sphere, Square, smooth_normals, transform_mesh
from .sky import Sky

__all__ = [
    "AmbientLight",
    "Box",
    "Camera",
    "Cone",
    "Cylinder",
    "DirectionalLight",
    "Environment",
    "Light",
    "Material",
    "Mesh",
    "PointLight",
    "Scene",
    "Shape",
    "Sky",
    "Sphere",
    "SpotLight",
    "Square",
    "Texture",
    "scene_digest",
    "smooth_normals",
    "transform_mesh",
]
