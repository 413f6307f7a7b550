"""Files of other programs, read as shapes and scenes."""
