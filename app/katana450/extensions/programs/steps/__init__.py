"""The steps of a script, a module for each subject."""
