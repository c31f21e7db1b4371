"""Recordings made elsewhere, read as they are."""
