"""The file modelDescription.xml; the reference of a variable is its place in the list, after the time."""

from collections.abc import Iterator
from importlib.metadata import version
from xml.etree import ElementTree as Xml

from bridge.fmu.model import Model, Variable

_LONG_S = 10.0  # length of the experiment that the file proposes


def description(model: Model, fmi: int, library: str, token: str) -> str:
    """The file for FMI 2 or 3."""
    names = {2: ("guid", "canGetAndSetFMUstate", "canSerializeFMUstate")}
    token_name, can_set, can_serialize = names.get(
        fmi, ("instantiationToken", "canGetAndSetFMUState", "canSerializeFMUState")
    )
    root = Xml.Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{fmi}.0", "modelName": model.name, token_name: token, "version": version("stickslip"),
            "description": model.about, "generationTool": "stickslip", "variableNamingConvention": "structured",
        },
    )  # fmt: skip
    step = repr(model.step_s)
    about = {
        "modelIdentifier": library,
        "canHandleVariableCommunicationStepSize": "false",
        can_set: "true",
        can_serialize: "true",
    }
    Xml.SubElement(root, "CoSimulation", about | ({"fixedInternalStepSize": step} if fmi > 2 else {}))
    variables = model.rows
    units = Xml.SubElement(root, "UnitDefinitions")
    for unit in sorted({variable.unit for variable in variables} - {""}):
        Xml.SubElement(units, "Unit", name=unit)
    Xml.SubElement(root, "DefaultExperiment", startTime="0", stopTime=str(_LONG_S), stepSize=step)
    (_add_variables_2 if fmi == 2 else _add_variables)(root, variables)
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _words(variables: list[Variable]) -> Iterator[tuple[Variable, dict[str, str], dict[str, str]]]:
    """Each variable with the attributes of any variable, and the attributes of a number."""
    kinds = {"independent": "continuous", "parameter": "tunable"}
    for reference, v in enumerate(variables):
        common = {"name": v.name, "valueReference": str(reference), "causality": v.causality}
        number = ({"unit": v.unit} if v.unit else {}) | ({"start": v.start} if v.start is not None else {})
        yield v, common | {"variability": kinds.get(v.causality, "discrete")}, number


def _add_variables(root: Xml.Element, variables: list[Variable]) -> None:
    rows, structure = Xml.SubElement(root, "ModelVariables"), Xml.SubElement(root, "ModelStructure")
    outputs = [str(reference) for reference, v in enumerate(variables) if v.causality == "output"]
    for v, common, number in _words(variables):
        element = Xml.SubElement(rows, v.type, common | number)
        if v.length > 1:
            Xml.SubElement(element, "Dimension", start=str(v.length))
    for kind in ("Output", "InitialUnknown"):
        for reference in outputs:
            Xml.SubElement(structure, kind, valueReference=reference)


def _add_variables_2(root: Xml.Element, variables: list[Variable]) -> None:
    rows, structure = Xml.SubElement(root, "ModelVariables"), Xml.SubElement(root, "ModelStructure")
    outputs = [str(place) for place, v in enumerate(variables, 1) if v.causality == "output"]
    for _, common, number in _words(variables):
        Xml.SubElement(Xml.SubElement(rows, "ScalarVariable", common), "Real", number)
    for kind in ("Outputs", "InitialUnknowns"):
        unknowns = Xml.SubElement(structure, kind)
        for place in outputs:
            Xml.SubElement(unknowns, "Unknown", index=place)
