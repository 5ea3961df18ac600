"""The .ray scene language."""

from .reader import parse_ray, read_ray

__all__ = ["parse_ray", "read_ray"]
