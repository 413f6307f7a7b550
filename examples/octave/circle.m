% Drive the circle of the 2013 paper from GNU Octave, with kinematics in m-code:
%
%   katana450 serve --lines 5560
%   octave-cli --path examples/octave --eval "port = 5560; circle"
%
% The circle is y^2 + (z + 110 mm)^2 = (100 mm)^2 at x = 150 mm in the frame {S}. The tip of the
% gripper follows it. The pitch varies from 62 degrees at the top to 88 at the bottom, so that every
% joint stays inside its limits. The angles are streamed, and the tool positions are read back.
if ! exist ("port", "var")
  port = 5560;
end
seconds = 12;
tip = 0.3028;
on_circle = @(t) [0.150, 0.100 * sin(t), -0.110 + 0.100 * cos(t)];
joints = @(t) katana_ik (on_circle (t), deg2rad (75 - 13 * cos (t)), 0, tip);

arm = katana_open (port, "Octave");
katana_say (arm, struct ("do", "acquire"));
katana_say (arm, struct ("do", "tool", "name", "tcp"));
start = state = katana_go (arm, joints (0));

% Difference of the tip positions by Octave's kinematics and by the server's.
start_error_mm = 1e3 * norm (state.T(1:3, 4)' - on_circle (0));

katana_say (arm, struct ("do", "watch", "hz", 50));
angles = zeros (0, 1);
asked = zeros (0, 5);
traced = zeros (0, 3);
started = tic ();
while (t = toc (started)) < seconds
  % Slow at both ends, so that the motion starts and ends smoothly.
  fraction = t / seconds;
  angle = 2 * pi * (fraction - sin (2 * pi * fraction) / (2 * pi));
  angles(end + 1, 1) = angle;
  asked(end + 1, :) = joints (angle);
  rate = 2 * pi / seconds * (1 - cos (2 * pi * fraction));
  ahead = joints (angle + 1e-4) - joints (angle - 1e-4);
  % With revocations, the server refuses it after a stop, even one that was cleared at once.
  request = struct ("do", "servo", "q", asked(end, :), "qd", rate * ahead / 2e-4, ...
                    "revocations", start.revocations);
  katana_say (arm, request);
  state = katana_hear (arm, "state");
  traced(end + 1, :) = state.T(1:3, 4)';
end
katana_say (arm, struct ("do", "watch", "hz", 0));
state = katana_go (arm, joints (2 * pi));
katana_say (arm, struct ("do", "release_lease", "id", 2));
katana_hear (arm, "done");
clear arm

% Distances of the tip from the circle [mm], without the lag of the arm behind the stream.
off_mm = 1e3 * hypot (traced(:, 1) - 0.150, hypot (traced(:, 2), traced(:, 3) + 0.110) - 0.100);
result = struct ("start_error_mm", start_error_mm, "largest_error_mm", max (off_mm), ...
                 "states", rows (traced), "angles", angles, "asked", asked);
printf ("%s\n", jsonencode (result));
