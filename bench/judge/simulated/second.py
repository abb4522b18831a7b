"""A second effect: the witnesses that are left when the first effect is in the model, for the same columns."""

from bench.judge.simulated.inputs import NAMES
from bench.judge.simulated.witnesses import Witnesses

_SHOWN = 10.0  # log evidence from which a place shows the first effect, so that it shows no second one


def beside(witnesses: Witnesses, first: str) -> Witnesses | None:
    """The witnesses of a further effect; None where the refitted rig was not asked for this first effect."""
    gains = {key.split(" ")[2]: value for key, value in witnesses.items() if key.startswith(f"beside {first} ")}
    if not gains:
        return None
    taken = {
        " ".join(key.split(" ")[:2])
        for key, value in witnesses.items()
        if key.endswith(f" {first}") and key.split(" ")[0] in {"line", "wave", "relation"} and value > _SHOWN
    }
    result: Witnesses = {}
    for key, value in witnesses.items():
        witness, place, what = key.split(" ", 2)
        if what not in NAMES:
            result[key] = value
        elif witness == "chosen":
            result |= {key: value, f"relation {place} {what}": value}
        elif witness != "fit" and what != first and f"{witness} {place}" not in taken:
            result.setdefault(key, value)
    result |= {f"fit rig {name}": value for name, value in gains.items()}
    result["fit rig chi2"] = witnesses["fit rig chi2"] - 2.0 * witnesses[f"fit rig {first}"]
    return {
        key: value for key, value in result.items() if not key.endswith(f" {first}") and not key.startswith("beside ")
    }
