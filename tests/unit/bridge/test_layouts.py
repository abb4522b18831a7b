"""The layouts for viewers: every topic and field that one names is in the descriptors, and has data in a short log."""

import ast
import json
import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.log.viewers import foxglove_log
from bridge.wire.messages import SCOPE
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario
from tests.unit.bridge.test_viewers import messages

FOLDER = Path(__file__).parents[3] / "deploy" / "layouts"
FOXGLOVE = json.loads((FOLDER / "foxglove.json").read_text())


@pytest.fixture(scope="module")
def scope(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    path = tmp_path_factory.mktemp("layouts") / "run.mcap"
    scenario = load_scenario("from-the-start", ["duration_s=0.5"])
    run_onboard(scenario, path, {})
    assert messages(path, "/log")
    return [message for message, _ in messages(path, "/scope")]


def paths_of_foxglove() -> list[str]:
    return [path["value"] for panel in FOXGLOVE["configById"].values() for path in panel.get("paths", ())]


def paths_of_plotjuggler() -> list[str]:
    """As topic.field; PlotJuggler names a curve /topic/field."""
    curves = ET.parse(FOLDER / "plotjuggler.xml").getroot().iter("curve")  # noqa: S314 (our own file)
    return [".".join(curve.attrib["name"].rsplit("/", 1)) for curve in curves]


def paths_of_rerun() -> list[str]:
    namespace: dict[str, Any] = {}
    for node in ast.parse((FOLDER / "view_in_rerun.py").read_text()).body:
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            namespace[node.targets[0].id] = ast.literal_eval(node.value)
    fields = [field for view in namespace["VIEWS"].values() for field in view]
    return [f"/scope.{field}" for field in (*fields, *namespace["WORDS"])]


@pytest.mark.parametrize("paths", [paths_of_foxglove, paths_of_plotjuggler, paths_of_rerun])
def test_every_path_is_a_field_with_data(scope: list[Any], paths: Any) -> None:
    named = paths()
    assert len(named) > 10
    for path in named:
        topic, field = path.split(".")
        assert topic == "/scope"
        assert field in SCOPE.dtype.names
        values = [getattr(message, field) for message in scope]
        assert all(math.isfinite(value) for value in values)
        if field not in {"limit", "time_to_slip_s"}:  # nothing may hold the command, and no slip be ahead
            assert np.any(values), field


def panels_in(place: Any) -> list[str]:
    return [place] if isinstance(place, str) else [*panels_in(place["first"]), *panels_in(place["second"])]


def test_the_foxglove_layout_is_of_the_published_format() -> None:
    """A tree of two halves with a direction and a share, whose leaves are panels `Type!id` with a configuration each."""
    assert set(FOXGLOVE) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert sorted(panels_in(FOXGLOVE["layout"])) == sorted(FOXGLOVE["configById"])
    kinds = {name.partition("!")[0] for name in FOXGLOVE["configById"]}
    assert kinds == {"Plot", "StateTransitions", "RosOut"}
    for panel in FOXGLOVE["configById"].values():
        assert all(path["timestampMethod"] == "receiveTime" for path in panel.get("paths", ()))
    assert FOXGLOVE["configById"]["RosOut!events"]["topicToRender"] == "/" + foxglove_log.TOPIC


def test_states_are_shown_by_words() -> None:
    """The panel for states names the numbers of an enum, and of nothing else."""
    for path in FOXGLOVE["configById"]["StateTransitions!words"]["paths"]:
        field = SCOPE.message.DESCRIPTOR.fields_by_name[path["value"].split(".")[1]]
        assert field.enum_type is not None


def test_the_plotjuggler_layout_is_of_its_format() -> None:
    root = ET.parse(FOLDER / "plotjuggler.xml").getroot()  # noqa: S314 (our own file)
    assert root.tag == "root"
    for splitter in root.iter("DockSplitter"):
        assert int(splitter.attrib["count"]) == len(splitter) == len(splitter.attrib["sizes"].split(";"))
    assert {tab.attrib["containers"] for tab in root.iter("Tab")} == {"1"}
