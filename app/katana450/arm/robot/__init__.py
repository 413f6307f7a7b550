"""From a URDF file to the arm the controller knows and the bodies the view draws."""
