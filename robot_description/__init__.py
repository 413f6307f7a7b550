"""The robot as data: the URDF, its meshes, and the code that builds them."""
