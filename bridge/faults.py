"""Every fault that an operator must act on: a short code, an exit status, a paragraph of help."""

from typing import NamedTuple


class FaultKind(NamedTuple):
    """One row of `FAULTS`."""

    code: str
    exit_status: int
    help: str


FAULTS = {
    kind.code: kind
    for kind in (
        FaultKind(
            "CONFIG",
            2,
            "A key of a configuration or scenario file, or an argument of the command line, is unknown, missing or out of "
            "range. The line names the file or option, the key, its value, the rule and the remedy. Correct it and repeat the "
            "command: nothing was started. Exception: a simulation whose numbers diverged; that run ended there.",
        ),
        FaultKind(
            "ENDPOINT_BUSY",
            3,
            "The plant cannot listen on the bus endpoint: another process (often an earlier run) holds the port, or the "
            "address does not belong to this computer. Or the rig has a controller already, and this is a second one. End the "
            "other process, or choose another port with --endpoint tcp/127.0.0.1:PORT.",
        ),
        FaultKind(
            "NO_PEER",
            4,
            "A process waited for its peer on the bus, but the peer did not come, left or did not answer. Check that the plant "
            "runs and that all processes use the same --endpoint and --prefix, and read the last line of the peer. If the line "
            "reports that the listening process is frozen, it is suspended or gets no processor time: resume it or end it. If "
            "the exciter vibrates, cut its amplifier by hand, because no command reaches the rig. With --cluster: no Dask "
            "scheduler answers at that address, or it has no workers.",
        ),
        FaultKind(
            "LOG_WRITE",
            5,
            "A log or another file could not be written: the disk is full, a size limit was reached, or the folder is not "
            "writable. Data written earlier are kept. Free space, or choose another folder. `stickslip log recover FILE` "
            "repairs a log that was cut off.",
        ),
        FaultKind(
            "NOT_SECURE",
            2,
            "Any program that reaches the bus of a rig can command its exciter. Therefore a rig listens beyond this computer "
            "only with TLS and certificates, a private key must not be readable by other users (mode 0600), and a Dask cluster "
            "beyond this computer needs tls://. Make certificates with `stickslip certs FOLDER`, then use --endpoint "
            "tls/HOST:PORT --certs FOLDER. --insecure allows an unprotected endpoint; use it only in a network of trusted "
            "computers. Nothing was started.",
        ),
        FaultKind(
            "LOG_LOST",
            5,
            "The file of a log was deleted, renamed, truncated or replaced by another program during the recording. The "
            "recording went on in the next file (NAME-0001.mcap and so on), which the line names. The first file is lost "
            "unless it exists under another name. Let no other program write to the folder of a recording.",
        ),
        FaultKind(
            "PEER_DIED",
            6,
            "A process of the run ended before the run did: it was killed, or it failed (see its line above). The other "
            "processes were stopped and the log was closed; it holds all blocks up to that moment. Remove the cause and repeat "
            "the run.",
        ),
        FaultKind(
            "BAD_LOG",
            7,
            "The file is not a run log of this project, is damaged beyond its first chunk, has another schema version, or "
            "lacks data that the command needs: an imported log has no controller to judge or replay. `stickslip log check "
            "FILE` lists the contents of any log; `stickslip log recover FILE` saves the readable part.",
        ),
        FaultKind(
            "BAD_MESSAGE",
            8,
            "A message on the bus does not follow bridge/wire/PROTOCOL.md: wrong length, undecodable bytes, a number of "
            "samples other than configured, or block numbers that decrease. The line names the topic. Compare the client with "
            "PROTOCOL.md.",
        ),
        FaultKind(
            "LOCKSTEP_STALLED",
            9,
            "In lockstep the plant waits for the command that answers its block; none came within 5 s. The controller hangs, "
            "has ended, or answers another block number. Read its last line, then repeat the run.",
        ),
        FaultKind(
            "BAD_EVIDENCE",
            2,
            "An evidence folder cannot be used. The line names the file, the key or column, the row, the rule and the remedy. "
            "Nothing was written. `stickslip log import FILE --map MAP.toml --out FOLDER` makes such a folder from a CSV, "
            "Parquet, MATLAB or TDMS file.",
        ),
        FaultKind(
            "BAD_TABLE",
            2,
            "A file of measured data cannot be read as a table, or lacks a column that the channel map names. The line names the "
            "file, the column, the row and the remedy. Nothing was written.",
        ),
        FaultKind(
            "DIAGNOSIS_BROKE",
            10,
            "The diagnosis of one of several folders failed by an error in the program; the line names the folder and the "
            "error. The other folders are not affected. `stickslip diagnose` on that folder alone prints the whole error; "
            "please report it together with the evidence.",
        ),
        FaultKind(
            "BAD_SET",
            2,
            "A set of blind cases, its key or its results cannot be used: a file is missing or has another content, or cases "
            "have no result yet. The line names the file, the rule and the remedy. The answers stay sealed.",
        ),
        FaultKind(
            "SEAL_BROKEN",
            11,
            "An answer in the key, or the evidence of a case, has another hash than the one recorded when the set was made, so "
            "a score would be meaningless. Restore the original files, or make a new set.",
        ),
        FaultKind(
            "MISSING_EXTRA",
            12,
            "Without extras, stickslip controls, records, replays and judges runs. Diagnosis, tables and reports need further "
            "packages; the line names the first missing one. `pip install 'stickslip[all]'` adds them to the environment of "
            "stickslip, in a clone `make check`; with pipx or uv, reinstall stickslip with [all]. Nothing was started.",
        ),
        FaultKind(
            "NO_MEMORY",
            13,
            "A command needed more memory than the computer has or than its limit allows. The line names the input files. Do "
            "not trust a log that claims far more data than its duration can hold: it is damaged or malicious. Otherwise end "
            "other programs, raise the limit, or take a part of the file.",
        ),
        FaultKind(
            "NOT_JUDGED",
            14,
            "The verdict on a run is neither ok nor not ok: nothing was tested, a decisive sensor does not work, or too many "
            "blocks are missing (more than 1 %, or within a slip). The line `control` gives the reason. Correct it and repeat "
            "the run; if blocks are missing, the lines `data` and `computer` show where they were lost.",
        ),
        FaultKind(
            "INTERRUPTED",
            130,
            "The command was ended by Ctrl-C, SIGTERM or the closing of its terminal (SIGHUP). In real time the vibration was "
            "ramped down first. An open log was closed, finished results are kept, and every process has ended.",
        ),
    )
}


class Fault(Exception):
    """A fault: its row of `FAULTS`, and one line for the user.

    The line has the form `where = value: rule; remedy`. Raises KeyError for a code that is not in `FAULTS`.
    """

    def __init__(self, code: str, line: str) -> None:
        self.kind = FAULTS[code]
        self.line = line
        Exception.__init__(self, f"{code}: {line}")

    def __reduce__(self) -> tuple[type["Fault"], tuple[str, str]]:
        """Pickle code and line, for another process; by default Python rebuilds an exception from its message alone."""
        return Fault, (self.kind.code, self.line)
