function state = katana_go (arm, q)
  % Drive all joints to q (1x5) [rad]; the state once the arm is at rest there.
  katana_say (arm, struct ("do", "joints", "q", q, "id", 1));
  done = katana_hear (arm, "done");
  do
    pause (0.05);
    katana_say (arm, struct ("do", "look"));
    state = katana_hear (arm, "state");
    if ischar (state.stopped)
      error ("katana: %s", state.stopped);
    end
  until state.ticket >= done.ticket && ! state.moving
end
