function q = katana_ik (p, pitch, roll, tool)
  % Joint angles (1x5) [rad] that bring the tool point to p (1x3) [m] in the frame {S}, the tool
  % pitch below the horizontal and turned by roll [rad]: shoulder in front, elbow up.
  %
  % The arm's product of exponentials, solved from the outside in. Axis 1 turns the arm's plane to
  % the point (Paden-Kahan subproblem 1). In it the pitch fixes where the wrist is; its distance
  % from the shoulder gives axis 3 (subproblem 3), its direction axis 2 (subproblem 1).
  %
  % tool: distance of the tool point from axis 4 [m]; 0.1883 is the bare flange.
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
  % z is up and angles about y count downwards.
  theta2 = -atan2 (z, r) - atan2 (fore * sin (theta3), upper + fore * c3);
  q = [theta1, theta2, theta3, pitch - theta2 - theta3, roll];
end
