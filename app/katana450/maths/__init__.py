"""Pure mathematics: geometry, kinematics, collision, motion, planning, water."""
