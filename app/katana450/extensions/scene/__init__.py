"""Scenes as YAML texts that people read and write."""
