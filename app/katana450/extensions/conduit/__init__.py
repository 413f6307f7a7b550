"""The conduit that carries the cables of an arm, in the scene and in pictures."""
