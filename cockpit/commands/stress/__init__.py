"""Commands that test a running loop: `fault` and `soak`."""
