"""How near the arm is to itself and to what stands around it, and how far it may go. Pure."""
