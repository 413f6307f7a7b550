function q = katana_ik (p, pitch, roll, tool)
  % Return joint angles (1x5) [rad] that bring the tool point to p (1x3) [m] in the frame {S}, with the
  % tool pitched below the horizontal and rolled by pitch and roll [rad]: shoulder front, elbow up.
  %
  % Axis 1 turns the plane of the arm to the point (Paden-Kahan subproblem 1). In this plane the pitch
  % determines the position of the wrist. Its distance from the shoulder gives axis 3 (subproblem 3),
  % its direction axis 2 (subproblem 1).
  %
  % tool: distance of the tool point from axis 4 [m]; 0.1883 for the bare flange.
  upper = 0.190;
  fore = 0.139;
  theta1 = atan2 (p(2), p(1));
  r = hypot (p(1), p(2)) - tool * cos (pitch);
  z = p(3) + tool * sin (pitch);
  c3 = (r^2 + z^2 - upper^2 - fore^2) / (2 * upper * fore);
  if abs (c3) > 1
    error ("katana_ik: the point is out of reach by axis 3");
  end
  theta3 = acos (c3);
  % z points up, and positive angles about y point down.
  theta2 = -atan2 (z, r) - atan2 (fore * sin (theta3), upper + fore * c3);
  q = [theta1, theta2, theta3, pitch - theta2 - theta3, roll];
end
