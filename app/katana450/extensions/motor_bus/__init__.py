"""Buses of servos: packets, exchanges within deadlines, calibration files of LeRobot."""
