"""How long a test waits for what must come, where nothing is judged by how soon it does."""

# On a computer with ten other busy programs a start of 1 s takes 20 to 60 s; a test that hangs is still reported before the limit
# of a whole test (`timeout` in pyproject.toml, 1800 s).
PATIENCE_S = 600.0
