function state = katana_rest (arm, done)
  % The state once the arm is at rest with the order in it that done (an answer) is of.
  do
    pause (0.05);
    katana_say (arm, struct ("do", "query"));
    state = katana_hear (arm, "state");
    if ischar (state.stopped)
      error ("katana: %s", state.stopped);
    end
  until state.ticket >= done.ticket && ! state.moving
end
