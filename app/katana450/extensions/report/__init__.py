"""What a run was like: its trace, its measures, its figures, and the files that show them."""
