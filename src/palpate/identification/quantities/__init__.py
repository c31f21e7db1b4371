"""Quantities derived from an identified law: impacts, energy, passivity and elastic modulus."""
