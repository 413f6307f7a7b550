function state = katana_rest (arm, done)
  % Wait until the command that done (an answer) confirms is executed. Return the state at rest.
  do
    pause (0.05);
    katana_say (arm, struct ("do", "query"));
    state = katana_hear (arm, "state");
    if ischar (state.stopped)
      error ("katana: %s", state.stopped);
    end
  until state.ticket >= done.ticket && ! state.moving
end
