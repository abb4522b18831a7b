"""`stickslip scenarios`: what comes with the project."""

import json
import sys

from cockpit.commands.options import Json
from cockpit.run.child_process import guarded


def scenarios(as_json: Json = False) -> None:
    """List the scenarios and rigs that come with the project."""

    def work() -> None:
        from bridge.config import read_toml
        from cockpit.run.scenario import deploy_folder

        found = {
            path.stem: str(read_toml(path).get("description", ""))
            for path in sorted(deploy_folder().glob("scenarios/*.toml"))
        }
        rigs = [path.stem for path in sorted(deploy_folder().glob("rigs/*.toml"))]
        if as_json:
            print(json.dumps({"scenarios": found, "rigs": rigs}))
            return
        for name, description in found.items():
            print(f"{name:<24} {description}")
        print("rigs: " + ", ".join(rigs))

    sys.exit(guarded(work, as_json))
