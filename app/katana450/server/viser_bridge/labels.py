"""Labels of the controls that the guard treats differently from the others."""

PERSONAL = ("View", "Theme")
"""Controls that affect only the window in which they are clicked."""
