"""Features beyond the core: programs, files of other programs, pictures, maps."""
