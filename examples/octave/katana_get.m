function values = katana_get (arm, nodes, field)
  % Return the present values of a field of nodes (cellstr, DEF names of the VRML world), one row per
  % node, as Simulink's VR Source does.
  request = struct ("do", "get", "node", nodes{1}, "field", field);
  request.more = cellfun (@(node) struct ("node", node, "field", field), nodes(2:end), ...
                          "UniformOutput", false);
  katana_say (arm, request);
  answer = katana_hear (arm, "values");
  values = cell2mat (arrayfun (@(each) each.value(:)', answer.values(:), "UniformOutput", false));
end
