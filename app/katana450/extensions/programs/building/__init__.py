"""The state in which a script is planned, with the actions and conditions that steps share."""
