"""Scattering: one file a lobe. All work in the local frame, where wo.z > 0 and z is the shading normal."""
