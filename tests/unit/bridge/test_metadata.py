"""A damaged configuration in a log: every command that needs it ends with BAD_LOG, and `log check` reports it."""

from pathlib import Path

import pytest

from bridge.faults import Fault
from bridge.log.check.log_check import check_log
from bridge.log.logfile import read_run
from cockpit.judge.judged import judge
from cockpit.run.replay import replay_log
from tests.logs import short_log, tables_of, write

SOUND = '{"block_s": 0.001, "policy": {"enabled_from_s": 0.0}}'


def _log(folder: Path, controller: str | None) -> Path:
    """The short log with another configuration of its controller, or with none of any process."""
    sound, path = folder / "sound.mcap", folder / "run.mcap"
    sound.write_bytes(short_log())
    run = read_run(sound)
    changed = run.headers | {"controller": run.headers["controller"] | {"configuration": controller or ""}}
    write(path, tables_of(run), run._replace(headers={} if controller is None else changed))
    return path


@pytest.mark.parametrize(
    ("configuration", "why"),
    [
        ("[" * 100_000, "is damaged, not JSON"),
        ('{"block_s": ' + "9" * 5000 + "}", "is damaged, not JSON"),
        ("null", "must be a JSON object"),
        ("[1, 2]", "must be a JSON object"),
        (None, "holds no configuration of the controller"),
        (SOUND.replace("0.001", "0"), "must hold block_s as a positive number"),
        (SOUND.replace("0.001", "9" * 400), "must hold block_s as a positive number"),
        (SOUND.replace("0.001", "NaN"), "must hold block_s as a positive number"),
        (SOUND.replace("0.001", "true"), "must hold block_s as a positive number"),
    ],
)
def test_a_configuration_that_cannot_be_used_is_a_bad_log(tmp_path: Path, configuration: str | None, why: str) -> None:
    path = _log(tmp_path, configuration)
    with pytest.raises(Fault, match=f"BAD_LOG: .*{why}"):
        judge(path)
    with pytest.raises(Fault, match=r"(BAD_LOG|CONFIG): .*(configuration|block_s)"):
        replay_log(path, 0.0, [])
    findings = [finding for finding in check_log(path).findings if finding.kind == "configuration"]
    assert why in findings[0].text
    assert findings[0].where == "run.mcap"


def test_a_bad_configuration_is_not_blamed_on_a_setting(tmp_path: Path) -> None:
    path = _log(tmp_path, '{"block_s": NaN}')
    for settings in ([], ["limits.v_ratio=1.3"]):
        with pytest.raises(Fault, match=r"CONFIG: run\.mcap: block_s = nan: must be a finite number"):
            replay_log(path, 0.0, settings)
