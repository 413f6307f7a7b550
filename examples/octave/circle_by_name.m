% Drive the circle of the 2013 paper as its Simulink model does: set the rotations of Transforms of
% the VRML world by their DEF names, and read them back.
%
%   katana450 serve --lines 5560
%   octave-cli --path examples/octave --eval "port = 5560; circle_by_name"
%
% The angles come from kinematics in m-code. Setting a rotation moves the arm under its limits;
% reading it returns where the arm is.
if ! exist ("port", "var")
  port = 5560;
end
if ! exist ("places", "var")
  places = 8;
end
tip = 0.3028;
axes = {"axis_1", "axis_2", "axis_3", "axis_4", "axis_5"};
about = [0, 0, 1; 0, 1, 0; 0, 1, 0; 0, 1, 0; 1, 0, 0];
angles = 2 * pi * (0:places - 1)' / places;

arm = katana_open (port, "VR Sink");
asked = zeros (places, 5);
heard = zeros (places, 5);
for k = 1:places
  on_circle = [0.150, 0.100 * sin(angles(k)), -0.110 + 0.100 * cos(angles(k))];
  asked(k, :) = katana_ik (on_circle, deg2rad (75 - 13 * cos (angles(k))), 0, tip);
  katana_rest (arm, katana_set (arm, axes, "rotation", [about, asked(k, :)']));
  rotations = katana_get (arm, axes, "rotation");
  heard(k, :) = rotations(:, 4)';
end
katana_say (arm, struct ("do", "release_lease", "id", 2));
katana_hear (arm, "done");
clear arm

result = struct ("angles", angles, "asked", asked, "heard", heard, ...
                 "largest_difference_rad", max (abs (asked(:) - heard(:))));
printf ("%s\n", jsonencode (result));
