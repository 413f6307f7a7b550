"""Cameras beside the scene, which show the real arm: their pictures and the ages of these."""
