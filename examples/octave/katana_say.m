function katana_say (arm, request)
  % Send one request, a struct. docs/api.md lists all requests.
  write (arm, uint8 ([jsonencode(request), "\n"]));
end
