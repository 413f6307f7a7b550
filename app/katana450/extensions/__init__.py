"""What the arm can do without: programs, files of other programs, pictures, maps."""
