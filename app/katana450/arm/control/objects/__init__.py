"""Objects around the arm: their support, their grip, their water."""
