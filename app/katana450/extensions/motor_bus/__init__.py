"""The bus of Feetech servos: packets, exchanges within deadlines, calibration files of LeRobot."""
