"""Parameters of an effect that differ from run to run: `NAME of FILE`, for the fitted runs. No rig file has them."""

from collections.abc import Mapping

Table = Mapping[str, float | str]
_OF = " of "


def of_run(name: str, file: str) -> str:
    """The name of a parameter in one run."""
    return name + _OF + file


def is_of_run(name: str, parameter: str = "") -> bool:
    """Whether a name is of one run, of any parameter or of this one."""
    return name.startswith(parameter + _OF) if parameter else _OF in name


def name_and_run(name: str) -> tuple[str, str]:
    """The parameter, and the file of its run or nothing."""
    parameter, _, file = name.partition(_OF)
    return parameter, file


def as_in_rig_file(table: Table) -> dict[str, float | str]:
    """The effect without what is of single runs."""
    return {name: value for name, value in table.items() if not is_of_run(name)}
