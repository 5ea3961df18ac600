"""NVIDIA GPUs: upload, schedulers, download."""
