function state = katana_go (arm, q)
  % Drive all joints to q (1x5) [rad]. Return the state when the arm is at rest there.
  katana_say (arm, struct ("do", "joints", "q", q, "id", 1));
  state = katana_rest (arm, katana_hear (arm, "done"));
end
