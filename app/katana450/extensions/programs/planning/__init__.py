"""The planning of curves, postures, hands and vessels, without a script."""
