"""Where the gap between rig and model lies; for now: what a stick-slip record looks like in `cycles`."""
