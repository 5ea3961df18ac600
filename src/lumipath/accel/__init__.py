"""Bounding volume hierarchies: building, layouts, traversal."""
