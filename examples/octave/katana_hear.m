function answer = katana_hear (arm, kind)
  % Return the next answer of a kind, a struct. Raise an error if a request was refused.
  persistent unread = "";
  do
    while ! any (unread == "\n")
      waiting = max (arm.NumBytesAvailable, 1);
      unread = [unread, char(read (arm, waiting))];
    end
    stop = find (unread == "\n", 1);
    answer = jsondecode (unread(1:stop - 1));
    unread = unread(stop + 1:end);
    if strcmp (answer.is, "refused")
      error ("katana: %s", answer.why);
    end
  until strcmp (answer.is, kind)
end
