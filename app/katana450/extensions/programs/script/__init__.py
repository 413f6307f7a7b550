"""Scripts: their parts, files and scenes."""
