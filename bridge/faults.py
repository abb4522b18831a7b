"""Every fault that a person has to act on: a short code, an exit status, a paragraph of help."""

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
            "A configuration or scenario file has a key, or the command line a word, that is unknown, missing or out of range. "
            "The line names the file or option, the key, its value, the rule and the remedy. Nothing was started; but where a "
            "rig's numbers ran away, the run ended there.",
        ),
        FaultKind(
            "ENDPOINT_BUSY",
            3,
            "The plant could not listen on the bus endpoint: another process (often an earlier run) holds the port, or the "
            "address is not one of this computer. Or a second controller came to a rig that has one. End that process, or "
            "choose another port with --endpoint tcp/127.0.0.1:PORT.",
        ),
        FaultKind(
            "NO_PEER",
            4,
            "A process waited for its peer on the bus and nobody came, or the peer went away or did not answer. Check that the "
            "plant runs, that every process names the same --endpoint and --prefix, and look at the peer's own last line. Where "
            "the line says that what listens stands still, its process is frozen or gets no processor time: let it go on, or end "
            "it. If something vibrates meanwhile, stop the exciter's amplifier by hand: no word reaches the rig. With "
            "--cluster: no Dask scheduler answers at that address, or it has no worker.",
        ),
        FaultKind(
            "LOG_WRITE",
            5,
            "A log or another file could not be written: the disk is full, a size limit was reached, or the folder is not "
            "writable. What was written before is kept. Free space, or choose another place. `stickslip log recover FILE` "
            "makes a cut log whole.",
        ),
        FaultKind(
            "NOT_SECURE",
            2,
            "Whoever reaches the bus of a rig can stop and command its exciter. So a rig listens beyond this computer only with "
            "TLS and certificates (`stickslip certs FOLDER`, then --endpoint tls/HOST:PORT --certs FOLDER), a key must be closed "
            "to others (mode 0600), and a Dask cluster beyond this computer needs tls://. --insecure allows a plain endpoint on "
            "a network of trusted computers alone. Nothing was started.",
        ),
        FaultKind(
            "LOG_LOST",
            5,
            "The file of a log was deleted, renamed, cut or replaced while it was recorded. The recording went on in the next "
            "file, NAME-0001.mcap and so on, which the line names; what was in the first file is gone unless it has another name "
            "now. Nothing else should write where a log is recorded.",
        ),
        FaultKind(
            "PEER_DIED",
            6,
            "A process of the run ended before the run did (killed, or it failed by itself: see its line above). The "
            "others were stopped and the log was closed. Blocks up to the death are in the log.",
        ),
        FaultKind(
            "BAD_LOG",
            7,
            "The file is not a run log of this project, is damaged beyond its first chunk, holds another schema version, or "
            "lacks what the command needs: one that was imported has no controller to judge or to replay. `stickslip log check "
            "FILE` says what is in a log of any kind; `stickslip log recover FILE` saves what can be read.",
        ),
        FaultKind(
            "BAD_MESSAGE",
            8,
            "A message on the bus does not follow bridge/wire/PROTOCOL.md: wrong length, undecodable bytes, another number of "
            "samples than configured, or blocks whose numbers go back. The line names the topic. Compare the client with "
            "PROTOCOL.md.",
        ),
        FaultKind(
            "LOCKSTEP_STALLED",
            9,
            "In lockstep the plant waits for the command that answers its block; none came in time. The controller "
            "hangs, died, or answers with another block number.",
        ),
        FaultKind(
            "BAD_EVIDENCE",
            2,
            "An evidence folder cannot be used: the line names the file, the key or column, the row, what was expected "
            "and what to do. Nothing was written. `stickslip log import FILE --map MAP.toml --out FOLDER` makes such a "
            "folder from a CSV, Parquet, MATLAB or TDMS file.",
        ),
        FaultKind(
            "BAD_TABLE",
            2,
            "A file of measured data cannot be read as a table, lacks a column that the channel map names, or is too "
            "large for the format that was asked for. The line names the file, the column and the row. Nothing was "
            "written.",
        ),
        FaultKind(
            "DIAGNOSIS_BROKE",
            10,
            "The diagnosis of one folder among many ended in an error of the program itself; the line says which and where. "
            "The other folders are not concerned. `stickslip diagnose` on that folder alone shows the whole error; please "
            "report it together with the evidence.",
        ),
        FaultKind(
            "BAD_SET",
            2,
            "A set of blind cases, its key or its results cannot be used: a file is missing or is something else, or cases "
            "have no result yet. The line names the file, what was expected and what to do. The answers stay closed.",
        ),
        FaultKind(
            "SEAL_BROKEN",
            11,
            "An answer in the key, or the evidence of a case, is not the one whose hash was written when the set was made. "
            "A score of it would mean nothing. Find the files as they were made, or make a new set.",
        ),
        FaultKind(
            "MISSING_EXTRA",
            12,
            "Installed without an extra, stickslip controls, records, replays and judges runs. Diagnosis, tables and reports "
            "need more packages, of which the line names the first that is not there. `pip install 'stickslip[all]'` adds them "
            "to the environment that has stickslip; with pipx or uv, install stickslip anew with [all]. Nothing was started.",
        ),
        FaultKind(
            "NO_MEMORY",
            13,
            "A command needed more memory than the computer, or a limit set for the command, allows. The line names the files it "
            "was given. A log that claims far more than a run of its length is damaged, or made to do this: do not trust it. "
            "Else end other programs, raise the limit, or take a part of the file.",
        ),
        FaultKind(
            "NOT_JUDGED",
            14,
            "The verdict on a run can be neither ok nor not ok: nothing was tested, a sensor that decides does not work, or "
            "blocks are missing where they decide (more than 1 %, or within a slip). The line `control` has the reason. "
            "Repeat the run; where blocks are missing, `data` and `computer` show who lost them.",
        ),
        FaultKind(
            "INTERRUPTED",
            130,
            "Somebody pressed Ctrl-C, ended the command (SIGTERM), or closed its terminal (SIGHUP). In real time the vibration "
            "was ramped down first. A log that was being written is closed, what is done stays, and every process has ended.",
        ),
    )
}


class Fault(Exception):
    """A fault: its row of `FAULTS`, and one line for the user.

    The line has the form `where = value: rule; what to do`. Raises KeyError for a code that is not in `FAULTS`.
    """

    def __init__(self, code: str, line: str) -> None:
        self.kind = FAULTS[code]
        self.line = line
        Exception.__init__(self, f"{code}: {line}")

    def __reduce__(self) -> tuple[type["Fault"], tuple[str, str]]:
        """Pickle code and line, for another process; by default an exception is made again from its message alone."""
        return Fault, (self.kind.code, self.line)
