"""The library behind ``import katana450``: arms, plans and their plots, for other programs."""
