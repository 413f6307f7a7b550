function katana_say (arm, request)
  % Send one request, a struct; docs/api.md tells which there are.
  write (arm, uint8 ([jsonencode(request), "\n"]));
end
