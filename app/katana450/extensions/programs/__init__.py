"""Scripts for people, the programs they become, and how those are run. Pure."""
