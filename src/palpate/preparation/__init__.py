"""From what was recorded to a contact: velocity, thresholds and units chosen from the data."""
