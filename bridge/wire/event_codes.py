"""The codes of events on the bus and in logs: sender, severity, cause and remedy."""

from typing import NamedTuple

# severity, in the letters of NAMUR NE 107
FAILURE, CHECK, OUTSIDE, MAINTENANCE, NEWS = "F", "C", "S", "M", ""
SEVERITIES = {
    FAILURE: "failure",
    CHECK: "check",
    OUTSIDE: "out of specification",
    MAINTENANCE: "maintenance",
    NEWS: "news",
}
# codes of letter C that a verdict lists nevertheless: a run with an injected fault does not show a healthy rig
TESTS = ("INJECTED",)
# reasons, in a controller's commands, for a vibration without the wanted effect
WEAK_REASONS = ("PIEZO_WEAK", "CANNOT_HELP", "HARMFUL")
# reasons that mark a sensor or the exciter as doubted; `controller.trips` detects them
TRIPS = (
    *("OPEN_LOOP", "CLIPPED", "SWAPPED", "FROZEN", "RESONANCE"),
    *("FORCE_DOUBTED", "DRIVE_DOUBTED", "TRAVEL_END", "NOISE"),
    *("SLIDE_DOUBTED", "POSITIONS_APART", "JUMPED", "LOOSE", "GAIN_OTHER"),
)


class EventCode(NamedTuple):
    """One row of `EVENTS`."""

    code: str
    sources: str  # senders: plant, controller, recorder
    letter: str  # severity, a key of SEVERITIES
    help: str


# fmt: off
EVENTS = {
    code.code: code
    for code in (
        EventCode("START", "plant, controller", NEWS, "the first block follows; the text gives the granted scheduling"),
        EventCode("END", "plant, controller", NEWS, "the run is over, or the controller sends no more commands"),
        EventCode("STALE", "controller", OUTSIDE,
            "no new block arrived in time: the computer stalled, the rig hangs or the link is cut. The vibration is ramped to "
            "zero until blocks arrive again (FRESH)"),
        EventCode("FRESH", "plant, controller", NEWS, "blocks or commands arrive again, or every sample is a number again"),
        EventCode("GUARD", "plant", CHECK, "the rig changed its state: `BEFORE -> STATE: CAUSE`"),
        EventCode("FAULT", "plant", FAILURE,
            "the guard tripped, or a check failed; the text gives the cause. Remove the cause, then `stickslip reset` and "
            "`stickslip arm`; until then nothing vibrates"),
        EventCode("GAIN_CHANGED", "plant", OUTSIDE,
            "the loop check measured an exciter gain that differs from the previous one by more than guard.gain_change: the "
            "exciter or its mount changed, or the sensitivity of the base accelerometer did. Nothing vibrates until a check "
            "finds the old gain again. If the new gain is right: `stickslip arm --accept-gain`"),
        EventCode("HELD_BACK", "plant", OUTSIDE, "a limit of the guard reduces the command; the text names the limit"),
        EventCode("FALLBACK", "plant", OUTSIDE,
            "no fresh command: the rig ramps to zero by itself. Check the controller and the link to it"),
        EventCode("STATE_FOLDER", "plant", MAINTENANCE,
            "an operator's stop could not be stored, so it would not outlast a restart of the rig. Make the folder writable "
            "that the text names"),
        EventCode("WIDE_LIMITS", "plant", MAINTENANCE,
            "limits of the guard protect less than the defaults. Narrow them in [guard] of the rig file, or document why they "
            "are needed"),
        EventCode("RIG_LOST", "controller", FAILURE,
            "no block for 1 s: the rig has left, or the link to it is cut; the text names the cause"),
        EventCode("RIG_BACK", "controller", NEWS, "blocks arrive again"),
        EventCode("RIG_RESTARTED", "controller", OUTSIDE,
            "the rig restarted its block numbers: it was started again, or another rig took its place. Control continues"),
        EventCode("PAUSED", "plant, controller", OUTSIDE,
            "this process stalled for more than 0.25 s: the computer is overloaded, or the process was suspended. Reduce the "
            "load"),
        EventCode("FOREIGN", "plant, controller, recorder", OUTSIDE,
            "a valid message that no known process of this run can have sent; it was dropped. Look for a second rig or "
            "controller on the same --endpoint and --prefix"),
        EventCode("REPEATED", "plant, controller, recorder", OUTSIDE, "a message arrived a second time and was dropped"),
        EventCode("FLOOD", "plant, controller, recorder", OUTSIDE,
            "more messages arrived than the process can read; some were dropped. Find the client that sends them"),
        EventCode("CLOCK", "controller, recorder", OUTSIDE,
            "t_ns of the blocks does not follow their numbers. Check the clock of the rig"),
        EventCode("NOT_FINITE", "controller", OUTSIDE,
            "a sample of a block is not a number (NaN or infinite): the vibration is ramped to zero. Check the sensor and its "
            "data acquisition"),
        EventCode("DRIVE_UNSEEN", "controller", OUTSIDE,
            "a slip while the drive position does not change: the drive transducer is at the end of its range, or loose. Check "
            "it; without v_d there is no vibration"),
        EventCode("OPEN_LOOP", "controller", FAILURE,
            "v_a is far below its commanded value at the known gain: the base accelerometer is loose or has another gain, or "
            "the exciter delivers less. Check both. The controller vibrates open loop at the known gain until `stickslip "
            "reset`"),
        EventCode("CLIPPED", "controller", FAILURE,
            "the base accelerometer is at the end of its range. Use a larger range. The controller vibrates open loop at the "
            "known gain until `stickslip reset`"),
        EventCode("SWAPPED", "controller", FAILURE,
            "the slide's accelerometer shows the vibration of the base, so the two are swapped. Swap them back, then "
            "`stickslip reset`"),
        EventCode("FROZEN", "controller", FAILURE,
            "a channel that has noise repeats one value: check its plug and its converter, then `stickslip reset`"),
        EventCode("RESONANCE", "controller", OUTSIDE,
            "v_a is far above its commanded value at the known gain: the exciter's mount is loose, or the accelerometer has "
            "another gain. Check the mount first; if slips return, check the accelerometer. The controller commands less"),
        EventCode("FORCE_DOUBTED", "controller", FAILURE,
            "the force does not follow the spring between drive and slide: the force sensor is dead, clipped or has another "
            "gain or sign, or the slide position is wrong. Check both. The controller vibrates whenever the drive moves until "
            "`stickslip reset`"),
        EventCode("DRIVE_DOUBTED", "controller", FAILURE,
            "the drive position does not follow slide and force: it jumped, froze or has another unit, or the force is at the "
            "end of its range. Check the encoder; if the force clips, use a larger range. Nothing vibrates until `stickslip "
            "reset`"),
        EventCode("SLIDE_DOUBTED", "controller", FAILURE,
            "the slide position moves faster than the drive: the channel has another unit, or is another channel. Correct the "
            "channel map. The controller vibrates whenever the drive moves until `stickslip reset`"),
        EventCode("POSITIONS_APART", "controller", FAILURE,
            "drive and slide move at different speeds although, by the force, no spring winds up: one of the two positions has "
            "another unit, or drifts. Check both. v_a follows the slower one until `stickslip reset`"),
        EventCode("JUMPED", "controller", OUTSIDE,
            "the drive position jumped and then went on as before. Check the encoder and its cable. Three jumps within 1 s are "
            "reported as DRIVE_DOUBTED"),
        EventCode("LOOSE", "controller", FAILURE,
            "the base accelerometer drops out repeatedly: check its plug. The controller vibrates open loop at the known gain "
            "until `stickslip reset`"),
        EventCode("GAIN_OTHER", "controller", OUTSIDE,
            "the loop check measured another gain than amplitude.known_gain. Compare the sensitivity of the base accelerometer "
            "with its data sheet, check its mounting position, or correct known_gain. The controller uses the measured gain"),
        EventCode("TRAVEL_END", "controller", OUTSIDE,
            "the drive is outside limits.travel_m, where the controller does not vibrate"),
        EventCode("NOISE", "controller", OUTSIDE,
            "the noise of the drive position became many times larger and is being learnt again; or more slips were counted "
            "than the spring can wind up for, and they are ignored; or noise covers the base accelerometer, and the controller "
            "vibrates open loop until `stickslip reset`. Check cables and grounding"),
        EventCode("LATE", "controller", OUTSIDE,
            "for at least 0.2 s blocks have arrived more than 15 ms later than before: the computer is busy, the link is slow, "
            "or the clock of the rig drifts"),
        EventCode("CLEARED", "controller", NEWS,
            "a sensor or the exciter is trusted again; the text gives the code of the event that ended"),
        EventCode("GAIN_LIMIT", "controller", OUTSIDE,
            "the amplitude loop asks for more stroke than amplitude.gain_band times the known gain allows, and is limited to "
            "that. Check the base accelerometer and the known gain"),
        EventCode("STROKE_MAX", "controller", OUTSIDE,
            "the stroke is limited by limits.amplitude_max_m, or v_a by limits.velocity_max_mps. Raise the limit if the "
            "exciter's data sheet allows it"),
        EventCode("PIEZO_WEAK", "controller", OUTSIDE,
            "v_a stays below 1.05 v_d with the stroke at its limit, or nearly no v_a is measured. Check exciter and base "
            "accelerometer; if both work, use a larger exciter or a stiffer mount, or reduce the drive speed"),
        EventCode("CANNOT_HELP", "controller", OUTSIDE,
            "slips continue at the strongest vibration, or at each change of v_d. Raise limits.amplitude_max_m or "
            "policy.most_ratio, or stiffen the drive"),
        EventCode("HARMFUL", "controller", OUTSIDE,
            "the motion was worse with vibration, twice: the controller does not vibrate in this direction until a new start"),
        EventCode("INJECTED", "plant", CHECK,
            "a fault that the scenario or an operator requested begins; the text gives the fault and its duration"),
        EventCode("INJECTION_ENDED", "plant", CHECK, "a requested fault is over"),
        EventCode("OPERATOR", "plant, controller", CHECK, "an operator's command was accepted: `ACTION by WHO`"),
        EventCode("WATCH", "recorder", NEWS,
            "whether the recorder watches for stalls of the computer: the cores, or the reason why not"),
        EventCode("PAUSE", "recorder", NEWS,
            "all cores that the recorder may use stalled together; the time is the beginning of the stall"),
        EventCode("CORE_PAUSE", "recorder", NEWS, "one core stalled"),
        EventCode("GAP", "recorder", FAILURE,
            "messages were lost on their way to the log: the computer or the link is overloaded. Reduce the load, or use a "
            "faster link"),
        EventCode("RESTART", "recorder", OUTSIDE,
            "sequence numbers fell by more than 256: the sender restarted, or two senders use one prefix"),
        EventCode("DROPPED", "recorder", FAILURE,
            "the recorder was too slow, and messages are missing from the log. Reduce the load of the computer"),
        EventCode("BAD_MESSAGE", "plant, controller, recorder", OUTSIDE,
            "a message could not be decoded and was dropped. Compare its sender with PROTOCOL.md"),
        EventCode("PLANT_LOST", "recorder", FAILURE,
            "the rig left the bus without an END; the log was closed with all messages received"),
        EventCode("LOG_WRITE", "recorder", FAILURE,
            "the disk is full, so the log cannot be written: control continues, nothing is recorded. Free space: recording "
            "then resumes, and a second event gives the number of lost messages"),
        EventCode("LOG_LOST", "recorder", FAILURE,
            "another program deleted, renamed or truncated the file of the log; the log continues in the next file"),
        EventCode("LOG_REPLACED", "recorder", FAILURE,
            "another file took the place of the log; the log continues in the next file"),
        EventCode("DISK_SLOW", "recorder", MAINTENANCE,
            "writing one chunk of the log took longer than 1 s. Messages were queued; none is lost unless DROPPED follows. Use "
            "a faster disk"),
    )
}
# fmt: on


def event_code(code: str) -> EventCode:
    """The row of a code; news without a meaning for a code of another version."""
    return EVENTS.get(code) or EventCode(code, "", NEWS, "not known to this version")


def harms(code: str) -> bool:
    """Whether a run with such an event fails."""
    return code in EVENTS and EVENTS[code].letter == FAILURE


def is_listed(code: str) -> bool:
    """Whether a verdict lists the event: every code but news and checks, and also TESTS and codes of other versions."""
    return code not in EVENTS or EVENTS[code].letter not in {NEWS, CHECK} or code in TESTS
