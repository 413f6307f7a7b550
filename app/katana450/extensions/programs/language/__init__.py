"""The language of scripts: YAML with lines, values with units, names and fields."""
