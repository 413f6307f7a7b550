"""Labels of the controls that the guard treats differently from the others."""

PACING = ("Motion", "Speed")
"""Controls that pause, resume and change the speed of a motion."""

PERSONAL = ("View", "Theme")
"""Controls that affect only the window in which they are clicked."""
