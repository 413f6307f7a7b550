function arm = katana_open (port, name)
  % Connect to `katana450 serve --lines PORT` on this machine.
  %
  % The driver must send ten heartbeats a second; each request is one.
  pkg load instrument-control
  arm = tcpclient ("127.0.0.1", port);
  katana_say (arm, struct ("do", "hello", "name", name));
  katana_hear (arm, "welcome");
end
