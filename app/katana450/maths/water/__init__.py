"""Water in a tilted cup: its surface, its flow and where it lands. Pure: time is an argument."""
