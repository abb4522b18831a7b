"""How long a test waits for what must come, where nothing is judged by how soon it does."""

# At the lowest priority, beside tests in real time, a process may get no core for seconds; one that hangs is still told before
# the limit of a whole test (`timeout` in pyproject.toml, 300 s).
PATIENCE_S = 100.0
