"""The codes of events on the bus and in logs: who says them, how bad they are, what they mean and what to do."""

from typing import NamedTuple

# how bad, in the letters of NAMUR NE 107
FAILURE, CHECK, OUTSIDE, MAINTENANCE, NEWS = "F", "C", "S", "M", ""
LETTERS = {
    FAILURE: "failure: something was lost, or does not do its work",
    CHECK: "check of function: a person's doing, or a test",
    OUTSIDE: "outside of what it is made for",
    MAINTENANCE: "needs a look before long",
    NEWS: "news",
}
# of letter C, and yet told with a run: it is no run of a healthy rig
TESTS = ("INJECTED",)
# reasons, in a controller's commands, that say the vibration does not do its work
WEAK_REASONS = ("PIEZO_WEAK", "CANNOT_HELP", "HARMFUL")
# reasons that say a sensor or the exciter is doubted; `controller.trips` finds them
TRIPS = (
    *("OPEN_LOOP", "CLIPPED", "SWAPPED", "FROZEN", "RESONANCE"),
    *("FORCE_DOUBTED", "DRIVE_DOUBTED", "TRAVEL_END", "NOISE"),
    *("SLIDE_DOUBTED", "POSITIONS_APART", "JUMPED", "LOOSE", "GAIN_OTHER"),
)


class EventCode(NamedTuple):
    """One row of `EVENTS`."""

    code: str
    sources: str  # who says it: plant, controller, recorder
    letter: str  # of LETTERS
    help: str


EVENTS = {
    one.code: one
    for one in (
        EventCode(
            "START", "plant, controller", NEWS, "the first block follows; the text says which scheduling was granted"
        ),
        EventCode("END", "plant, controller", NEWS, "the run is over, or no more commands come"),
        EventCode(
            "STALE",
            "controller",
            OUTSIDE,
            "no new block came in time: the vibration is ramped to zero. A computer that stalled, a rig that hangs or a link "
            "that is cut; FRESH says that blocks arrive again",
        ),
        EventCode(
            "FRESH",
            "plant, controller",
            NEWS,
            "blocks or commands arrive again, or every sample is a number again",
        ),
        EventCode("GUARD", "plant", CHECK, "the rig went to another state: `BEFORE -> STATE: CAUSE`"),
        EventCode(
            "FAULT",
            "plant",
            FAILURE,
            "the guard tripped, or a check failed; the text has the cause. Nothing vibrates until "
            "`stickslip reset`, and then `stickslip arm`",
        ),
        EventCode(
            "GAIN_CHANGED",
            "plant",
            OUTSIDE,
            "the loop check measured another gain of the exciter than the one before, beyond guard.gain_change: exciter or mount "
            "deliver less or more, or the base accelerometer shows another share. Nothing vibrates until a new check finds the "
            "old gain, or `stickslip arm --accept-gain`, where the new one is right",
        ),
        EventCode("HELD_BACK", "plant", OUTSIDE, "a limit of the guard holds the command back; the text has which"),
        EventCode(
            "FALLBACK",
            "plant",
            OUTSIDE,
            "no fresh command: the rig ramps to zero by itself. Look at the controller and the link to it",
        ),
        EventCode(
            "STATE_FOLDER",
            "plant",
            MAINTENANCE,
            "a person's stop could not be kept over a restart; make the folder writable that the text names",
        ),
        EventCode(
            "WIDE_LIMITS",
            "plant",
            MAINTENANCE,
            "limits of the guard protect less than the defaults; narrow them in [guard] of the rig file, or know why not",
        ),
        EventCode(
            "RIG_LOST",
            "controller",
            FAILURE,
            "no block for 1 s, and the rig or the link to it is gone, as the text says",
        ),
        EventCode("RIG_BACK", "controller", NEWS, "blocks come again"),
        EventCode("RIG_RESTARTED", "controller", OUTSIDE, "the rig counts its blocks anew, and is taken up again"),
        EventCode("PAUSED", "plant, controller", OUTSIDE, "this process itself stalled for more than 0.25 s"),
        EventCode("FOREIGN", "plant, controller, recorder", OUTSIDE, "a message that none of the known processes sent"),
        EventCode(
            "REPEATED", "plant, controller, recorder", OUTSIDE, "a message that was there already; it was dropped"
        ),
        EventCode(
            "FLOOD", "plant, controller, recorder", OUTSIDE, "more messages came than can be read; some were dropped"
        ),
        EventCode("CLOCK", "controller, recorder", OUTSIDE, "the time of the blocks does not follow their numbers"),
        EventCode(
            "NOT_FINITE",
            "controller",
            OUTSIDE,
            "a block holds a sample that is no number: the vibration is ramped to zero. Look at the sensor and at who reads it",
        ),
        EventCode(
            "DRIVE_UNSEEN",
            "controller",
            OUTSIDE,
            "a slip, while the drive position stands: its transducer is at its end, or loose, and no v_d means no vibration",
        ),
        EventCode(
            "OPEN_LOOP",
            "controller",
            FAILURE,
            "far less v_a than commanded, by the known gain: the base accelerometer is loose or has another gain, or the exciter "
            "delivers less. It vibrates open loop at the known gain until `stickslip reset`",
        ),
        EventCode(
            "CLIPPED",
            "controller",
            FAILURE,
            "the base accelerometer is at the end of what it shows. It vibrates open loop, at the known gain, until "
            "`stickslip reset`",
        ),
        EventCode(
            "SWAPPED",
            "controller",
            FAILURE,
            "the accelerometer of the slide shows what that of the base should: swap them back, then `stickslip reset`",
        ),
        EventCode(
            "FROZEN",
            "controller",
            FAILURE,
            "a channel with noise repeats one number: look at its plug and its converter, then `stickslip reset`",
        ),
        EventCode(
            "RESONANCE",
            "controller",
            OUTSIDE,
            "far more v_a than commanded, by the known gain: the exciter's mount is loose, or the accelerometer has another gain."
            " Less is commanded; slips that come back say that it is the accelerometer",
        ),
        EventCode(
            "FORCE_DOUBTED",
            "controller",
            FAILURE,
            "the force does not follow the spring between drive and slide: dead, clipped, of another gain or sign, or it is the "
            "place of the slide that is off. It vibrates whenever the drive moves until `stickslip reset`",
        ),
        EventCode(
            "DRIVE_DOUBTED",
            "controller",
            FAILURE,
            "the drive position does not follow slide and force: it jumped, froze or has another unit, or the force is at the "
            "end of its range. Look at the encoder; where the force clips, use a larger range. Nothing vibrates until "
            "`stickslip reset`",
        ),
        EventCode(
            "SLIDE_DOUBTED",
            "controller",
            FAILURE,
            "the place of the slide goes faster than its drive: another unit, or another channel. It vibrates whenever the drive "
            "moves until `stickslip reset`",
        ),
        EventCode(
            "POSITIONS_APART",
            "controller",
            FAILURE,
            "drive and slide go at different speeds, and the force says that no spring winds up by it: one of the two has "
            "another unit, or drifts. v_a is for the slower one until `stickslip reset`",
        ),
        EventCode(
            "JUMPED",
            "controller",
            OUTSIDE,
            "the place of the drive jumped, and went on as before: look at the encoder and its cable. Three jumps within a "
            "second are DRIVE_DOUBTED",
        ),
        EventCode(
            "LOOSE",
            "controller",
            FAILURE,
            "the base accelerometer drops out again and again: look at its plug. It vibrates open loop, at the known gain, until "
            "`stickslip reset`",
        ),
        EventCode(
            "GAIN_OTHER",
            "controller",
            OUTSIDE,
            "the loop check measured another gain than amplitude.known_gain: compare the sensitivity of the base accelerometer "
            "with its data sheet, look at its place, or correct known_gain. The gain that the check measured counts",
        ),
        EventCode(
            "TRAVEL_END", "controller", OUTSIDE, "the drive is outside of limits.travel_m, where nothing is vibrated"
        ),
        EventCode(
            "NOISE",
            "controller",
            OUTSIDE,
            "the noise of the drive's place became many times larger, and is learnt anew; or more slips came than the spring "
            "could wind up for, and are not believed; or noise drowns the base accelerometer, and it vibrates open loop until "
            "`stickslip reset`. Look at cables and earth",
        ),
        EventCode(
            "LATE",
            "controller",
            OUTSIDE,
            "for 0.2 s and more blocks have come more than 15 ms later than they did before: a busy computer, a slow link, or a "
            "clock that runs away",
        ),
        EventCode("CLEARED", "controller", NEWS, "a doubt about a sensor or the exciter is over; the text has which"),
        EventCode(
            "GAIN_LIMIT",
            "controller",
            OUTSIDE,
            "the amplitude loop wants more stroke than amplitude.gain_band times the known gain allows, and does not get it",
        ),
        EventCode(
            "STROKE_MAX",
            "controller",
            OUTSIDE,
            "the stroke is at limits.amplitude_max_m, or v_a at limits.velocity_max_mps, and more is wanted",
        ),
        EventCode(
            "PIEZO_WEAK",
            "controller",
            OUTSIDE,
            "v_a stays below 1.05 v_d with the stroke at its limit, or nearly none is measured: a larger exciter, or a "
            "stiffer mount",
        ),
        EventCode(
            "CANNOT_HELP",
            "controller",
            OUTSIDE,
            "slips go on with the strongest vibration, or whenever v_d changes: allow more (limits.amplitude_max_m, "
            "policy.most_ratio), or stiffen the drive",
        ),
        EventCode("HARMFUL", "controller", OUTSIDE, "the motion was worse with the vibration, twice: there is none"),
        EventCode(
            "INJECTED",
            "plant",
            CHECK,
            "a fault that a scenario or a person asked for begins; the text has which, and for how long",
        ),
        EventCode("INJECTION_ENDED", "plant", CHECK, "a fault that was asked for is over"),
        EventCode("OPERATOR", "plant, controller", CHECK, "a person's word was taken: `ACTION by WHO`"),
        EventCode("WATCH", "recorder", NEWS, "whether stalls of the computer are watched, on which cores, or why not"),
        EventCode("PAUSE", "recorder", NEWS, "every core that the recorder may use stalled; the time is when it began"),
        EventCode("CORE_PAUSE", "recorder", NEWS, "one core alone stalled"),
        EventCode(
            "GAP", "recorder", FAILURE, "messages were lost before they came to the log: a busy computer or link"
        ),
        EventCode(
            "RESTART",
            "recorder",
            OUTSIDE,
            "numbers went back by more than 256: the sender began anew, or there are two of them on one prefix",
        ),
        EventCode("DROPPED", "recorder", FAILURE, "the recorder was too slow, and messages are not in the log"),
        EventCode(
            "BAD_MESSAGE",
            "plant, controller, recorder",
            OUTSIDE,
            "a message could not be read, and was dropped; compare its sender with PROTOCOL.md",
        ),
        EventCode(
            "PLANT_LOST",
            "recorder",
            FAILURE,
            "the rig left the bus without an END; the log was closed with all that came",
        ),
        EventCode(
            "LOG_WRITE",
            "recorder",
            FAILURE,
            "the log cannot be written, as the disk is full: control goes on, and nothing is recorded until there is room. A "
            "second one says that there is, and how many messages are not in the log",
        ),
        EventCode(
            "LOG_LOST",
            "recorder",
            FAILURE,
            "the file of the log was deleted, renamed or cut by another program; the log goes on in the next file",
        ),
        EventCode(
            "LOG_REPLACED",
            "recorder",
            FAILURE,
            "another file took the place of the log; the log goes on in the next file",
        ),
        EventCode(
            "DISK_SLOW",
            "recorder",
            MAINTENANCE,
            "a chunk of the log took longer than 1 s to write; what came meanwhile waited, and nothing is lost without DROPPED",
        ),
    )
}


def harms(code: str) -> bool:
    """Whether a run with such an event is not good."""
    return code in EVENTS and EVENTS[code].letter == FAILURE


def is_told(code: str) -> bool:
    """Whether a verdict tells it: all that is more than news, tests, and what this version does not know."""
    return code not in EVENTS or EVENTS[code].letter not in {NEWS, CHECK} or code in TESTS
