"""The same contact in MuJoCo: what was identified, and what the engine's own contact does."""
