function done = katana_set (arm, nodes, field, values)
  % Set a field of nodes (cellstr, DEF names of the VRML world), as Simulink's VR Sink does. Row k of
  % values is for nodes{k}. All are set in one tick, or none if one is refused.
  % Return the answer, for katana_rest.
  settings = cell (1, numel (nodes));
  for k = 1:numel (nodes)
    settings{k} = struct ("node", nodes{k}, "field", field, "value", values(k, :));
  end
  request = settings{1};
  request.do = "set";
  request.id = 3;
  request.more = settings(2:end);
  katana_say (arm, request);
  done = katana_hear (arm, "done");
end
