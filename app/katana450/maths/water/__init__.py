"""Water: how a tilted cup holds it, loses it, and where it goes. Pure: time is an argument."""
