"""Readers of the file formats of meshes and scenes."""
