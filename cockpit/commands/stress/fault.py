"""`stickslip fault`: a fault of the catalogue, injected into a loop that runs."""

from typing import Annotated

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import Json, carry_out, tell
from cockpit.commands.options import DEFAULT_SCENARIO, Certs, Endpoint, Prefix, ScenarioName, as_settings


def fault(
    name: Annotated[str, typer.Argument(help="Of the catalogue: --list has them all.")] = "",
    for_s: Annotated[
        float | None, typer.Option("--for", min=0.0, help="How long [s]; 0: until --clear or the end of the run.")
    ] = None,
    clear: Annotated[bool, typer.Option("--clear", help="First end all faults that act at the rig.")] = False,
    known: Annotated[bool, typer.Option("--list", help="Print the catalogue and every kind of fault.")] = False,
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    certs: Certs = None,
    as_json: Json = None,
) -> None:
    """Inject a fault into a running loop of a simulated rig; a real rig takes none, and processes must be of this user."""

    def work() -> None:
        from cockpit.faults.catalogue import Known, find_entry, known_faults
        from cockpit.faults.injection import inject
        from cockpit.run.scenario_file import load_bus

        if known:
            there: Known = known_faults()
            tell(as_json, there, there.in_words())
            return
        if not (name or clear):
            raise Fault("CONFIG", "NAME: missing: must be a fault of the catalogue; see `stickslip fault --list`")
        tables = list(find_entry(name).entry.fault) if name else []
        if name and not tables:
            raise Fault(
                "CONFIG", f"{name}: is a person's word: must be a fault; see `stickslip {name.split('-')[0]} --help`"
            )
        changed = {} if for_s is None else {"for_s": for_s}
        tables = [type(one).model_validate(one.model_dump() | {"name": one.name or name} | changed) for one in tables]
        bus = load_bus(scenario, as_settings([], None, endpoint, prefix, certs))
        done = inject(bus, name or "clear", tables, clear)
        tell(as_json, done, done.in_words())

    carry_out(work, as_json)
