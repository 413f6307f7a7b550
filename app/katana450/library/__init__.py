"""The library behind ``import katana450``: arms, plans and pictures of them, for other programs."""
