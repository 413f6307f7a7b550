"""The scene and the panel of a robot that is driven joint by joint."""
