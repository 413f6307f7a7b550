"""The robot description: the URDF, its meshes, and the code that builds them."""
