"""The two sides between which a hand holds objects, from the bodies and joints of its fingers."""
