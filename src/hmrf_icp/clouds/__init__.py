"""Clouds, and what a cloud alone tells: camera, surface, range image, fewer points."""
