"""From a `Scene` to a `PackedScene`: flat arrays that kernels read."""
