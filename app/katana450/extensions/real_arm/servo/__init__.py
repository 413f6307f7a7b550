"""Arms of bus servos: their joints, their driver and an emulator."""
