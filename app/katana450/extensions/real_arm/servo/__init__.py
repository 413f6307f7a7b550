"""Arms of bus servos, SO-100 and SO-101: their joints, their driver and an emulator."""
