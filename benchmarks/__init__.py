"""Speed and memory of palpate, as ratios to something measured in the same run."""
