"""Scripts that run recorded motions again."""
