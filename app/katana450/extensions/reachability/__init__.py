"""Maps of the points that the tool reaches, and of the orientations that it can have there."""
