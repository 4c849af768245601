"""Scenes that are rendered with exactly known poses."""
