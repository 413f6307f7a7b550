function values = katana_get (arm, nodes, field)
  % That field of the nodes (cellstr, DEF names of the VRML world) as it is now, as Simulink's VR
  % Source reads it: a row each.
  request = struct ("do", "get", "node", nodes{1}, "field", field);
  request.more = cellfun (@(node) struct ("node", node, "field", field), nodes(2:end), ...
                          "UniformOutput", false);
  katana_say (arm, request);
  answer = katana_hear (arm, "values");
  values = cell2mat (arrayfun (@(each) each.value(:)', answer.values(:), "UniformOutput", false));
end
