"""Where the tool can be, and how freely it can be turned there."""
