"""Film, session and image."""
