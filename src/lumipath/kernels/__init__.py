"""The physics: plain scalar functions, written once for every device. No device and no NumPy API is named here."""
