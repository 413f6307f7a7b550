"""Scene objects and water, changed by people and programs."""
