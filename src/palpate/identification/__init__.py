"""Identification of a whole contact: replay, law, and comparison of several methods."""
