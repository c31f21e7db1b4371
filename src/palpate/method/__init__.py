"""The method: a contact, the settings, and the estimators that learn a law from it."""
