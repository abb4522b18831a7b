"""Show a run log in the Rerun viewer: curves, states in words and events, with a layout.

    pip install rerun-sdk mcap-protobuf-support
    python view_in_rerun.py run.mcap                   opens the viewer
    python view_in_rerun.py run.mcap --save run.rrd    writes a recording instead

Rerun opens a log by itself, too, but draws no curve of a message that it does not know: this script hands it scalars.
"""

import argparse

import rerun as rr
import rerun.blueprint as rrb
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

# title of a view: fields of /scope in it
VIEWS = {
    "Drive force [N]": ("drive_force_min_N", "drive_force_mean_N", "drive_force_max_N"),
    "Vibration and drive velocity [m/s]": ("vibration_velocity_mps", "wanted_velocity_mps", "drive_velocity_mps"),
    "Amplitude [m]": ("amplitude_m",),
    "Acceleration of the base [m/s2]": ("base_accel_min_mps2", "base_accel_mean_mps2", "base_accel_max_mps2"),
}
WORDS = ("mode", "state", "reason", "limit", "guard_state")
LEVELS = {1: "DEBUG", 2: "INFO", 3: "WARN", 4: "ERROR", 5: "CRITICAL"}


def layout() -> rrb.Blueprint:
    """Curves on the left, words and events on the right."""
    curves = [
        rrb.TimeSeriesView(name=title, contents=[f"/scope/{field}" for field in fields])
        for title, fields in VIEWS.items()
    ]
    told = [rrb.TextLogView(name="In words", origin="/words"), rrb.TextLogView(name="Events", origin="/log")]
    return rrb.Blueprint(rrb.Horizontal(rrb.Vertical(*curves), rrb.Vertical(*told), column_shares=[3, 2]))


def send(path: str) -> None:
    """Send /scope and /log of a log to the recording under way; the timeline `run` is the time of the run."""
    times: list[float] = []
    columns: dict[str, list[float]] = {field: [] for fields in VIEWS.values() for field in fields}
    before = dict.fromkeys(WORDS)
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, said in reader.iter_decoded_messages(topics=["/scope", "/log"]):
            rr.set_time("run", duration=message.publish_time / 1e9)
            if channel.topic == "/log":
                rr.log("log", rr.TextLog(f"{said.name}: {said.message}", level=LEVELS.get(said.level, "INFO")))
                continue
            times.append(said.t_ns / 1e9)
            for field, values in columns.items():
                values.append(getattr(said, field))
            for field in WORDS:
                number = getattr(said, field)
                if number != before[field]:
                    name = said.DESCRIPTOR.fields_by_name[field].enum_type.values_by_number[number].name
                    rr.log(f"words/{field}", rr.TextLog(f"{field}: {name}"))
                    before[field] = number
    for field, values in columns.items():
        rr.send_columns(f"scope/{field}", [rr.TimeColumn("run", duration=times)], rr.Scalars.columns(scalars=values))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("log", help="a run log, .mcap")
    parser.add_argument("--save", metavar="FILE.rrd", help="write a recording in place of opening the viewer")
    given = parser.parse_args()
    rr.init("stickslip", spawn=given.save is None, default_blueprint=layout())
    if given.save is not None:
        rr.save(given.save, default_blueprint=layout())
    send(given.log)
