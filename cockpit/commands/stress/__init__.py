"""Commands that try what is built: `bench` controller and guard, `fault` and `soak` a loop that runs."""
