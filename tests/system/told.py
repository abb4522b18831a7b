"""What a run said on stderr, but for the priority that this machine may not grant."""


def told(err: str) -> list[str]:
    """Its lines."""
    return [line for line in err.strip().splitlines() if not line.startswith("stickslip: warning: normal scheduling")]
