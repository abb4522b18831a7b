"""Make the golden logs again and write down their figures: `make bless REASON="why the change is wanted"`."""

import argparse
import datetime
import sys
import tomllib
from pathlib import Path
from typing import Any

from bridge.log.logfile import read_run
from cockpit.run.in_process import run_onboard
from cockpit.run.replay import outcome
from cockpit.run.scenario import load_scenario

FOLDER = Path(__file__).parent
SLACK = 0.05  # of a figure, on both sides


def situations() -> dict[str, dict[str, Any]]:
    """The rows of the manifest."""
    return tomllib.loads((FOLDER / "manifest.toml").read_text())


def make(name: str, path: Path) -> None:
    """Record one situation."""
    scenario = load_scenario("paper-c45-c45", situations()[name]["settings"])
    run_onboard(scenario, path, {"scenario": name})


def bless(reason: str) -> None:
    """Record all situations again, with their figures and the reason."""
    figures = ["# Figures of the golden logs: each may lie between its two numbers. Written by make bless."]
    for name in situations():
        path = FOLDER / f"{name}.mcap"
        make(name, path)
        figures.append(f"\n[{name}]")
        for field, value in outcome(read_run(path))._asdict().items():
            slack = SLACK * abs(value) if field != "slips" else 0
            figures.append(f"{field} = [{value - slack:.6g}, {value + slack:.6g}]")
    (FOLDER / "figures.toml").write_text("\n".join(figures) + "\n")
    with (FOLDER / "CHANGES.md").open("a") as changes:
        changes.write(f"- {datetime.datetime.now(datetime.UTC):%Y-%m-%d}: {reason}\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--reason", required=True, help="why the controller is meant to behave differently now")
    reason = parser.parse_args().reason.strip()
    if len(reason.split()) < 3:
        sys.exit(f"--reason {reason!r}: say in a sentence why the change is wanted")
    bless(reason)
