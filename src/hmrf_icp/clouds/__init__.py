"""Clouds, and what can be told of how they were seen."""
