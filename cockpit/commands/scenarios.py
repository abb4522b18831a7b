"""`stickslip scenarios`: what comes with the project."""

from typing import NamedTuple

from cockpit.commands.as_json.option import Json, carry_out, tell


class Known(NamedTuple):
    """What there is."""

    scenarios: dict[str, str]  # with what each is about
    rigs: list[str]


def scenarios(as_json: Json = None) -> None:
    """List the scenarios and rigs that come with the project."""

    def work() -> None:
        from bridge.config import read_toml
        from cockpit.run.scenario_file import deploy_folder

        found = {
            path.stem: str(read_toml(path).get("description", ""))
            for path in sorted(deploy_folder().glob("scenarios/*.toml"))
        }
        rigs = [path.stem for path in sorted(deploy_folder().glob("rigs/*.toml"))]
        words = [f"{name:<24} {description}" for name, description in found.items()]
        tell(as_json, Known(found, rigs), [*words, f"rigs: {', '.join(rigs)}"])

    carry_out(work, as_json)
