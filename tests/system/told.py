"""What a command said on stderr, but for its life, and what depends on this computer: its priority, how long judging takes."""

_LEFT_OUT = (
    *("stickslip: warning: normal scheduling", "judging the log; "),
    *("waiting  for ", "joined   ", "running  ", "ended    "),
)


def told(err: str) -> list[str]:
    """Its lines."""
    return [line for line in err.strip().splitlines() if not line.startswith(_LEFT_OUT)]
