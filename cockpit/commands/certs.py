"""`stickslip certs`: an authority and a certificate for each role, for a bus beyond one computer."""

from pathlib import Path
from typing import Annotated

import typer

from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import command
from cockpit.run.writable import check_output_folder


@command()
def certs(
    folder: Annotated[Path, typer.Argument(help="Folder for the certificates; created if missing.")],
    hosts: Annotated[
        list[str], typer.Option("--host", help="Additional name or address of the rig's computer. Repeatable.")
    ] = [],  # noqa: B006
    as_json: Json = None,
) -> None:
    """Make certificates for the roles rig, controller, recorder, operator and viewer, for a bus over TLS; keys have mode 0600.

    An authority that is already in the folder signs them; an existing certificate is never replaced.
    """
    from cockpit.run.authority import make_certificates

    check_output_folder("FOLDER", folder)
    made = make_certificates(folder, hosts)
    lines = [
        f"made     {', '.join(name for name in made.files if name.endswith('.pem'))} and their keys in {made.folder}",
        f"rig at   {', '.join(made.hosts)}",
        f"until    {made.until}",
        "next     give each computer authority.pem and the two files of its role; keep authority.key secret",
    ]
    print_result(as_json, made, lines)
