"""Lines of a command on stderr, without its lifecycle, priority and time of judging."""

_LEFT_OUT = (
    *("stickslip: warning: normal scheduling", "judging the log; "),
    *("waiting  for ", "joined   ", "running  ", "ended    "),
)


def told(err: str) -> list[str]:
    """Its lines."""
    return [line for line in err.strip().splitlines() if not line.startswith(_LEFT_OUT)]
