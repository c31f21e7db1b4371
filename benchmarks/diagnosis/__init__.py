"""How often an identification is wrong, and how often its diagnosis warns."""
