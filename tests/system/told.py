"""What a run said on stderr, but for what depends on this machine: the priority that it grants, how long judging takes."""

_OF_THE_MACHINE = ("stickslip: warning: normal scheduling", "judging the log; ")


def told(err: str) -> list[str]:
    """Its lines."""
    return [line for line in err.strip().splitlines() if not line.startswith(_OF_THE_MACHINE)]
