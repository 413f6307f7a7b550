"""Reading a URDF file: the arm for the controller and the bodies for the view."""
