"""Labels of the controls that the message filter has to tell from the others."""

PACING = ("Motion", "Speed")
"""Controls that pause, resume and slow down what moves."""

PERSONAL = ("View", "Theme")
"""Controls that concern only the window in which they are clicked."""
