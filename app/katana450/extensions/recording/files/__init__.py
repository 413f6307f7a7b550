"""MCAP files of recordings: writing, reading, repair and cutting."""
