"""Commands that try a loop: `fault` injects a fault into one that runs, `soak` watches one for hours."""
