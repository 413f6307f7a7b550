"""The commands ``katana450 fk`` and ``katana450 ik``, for other programs."""
