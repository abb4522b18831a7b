"""The answer of a diagnosis; its JSON (`diagnosis/3`) is a fixed contract."""

import math
from pathlib import PurePath
from typing import Final, Literal, NamedTuple

from bridge.arrays import Floats
from bridge.log.finding import Finding
from bridge.results import in_json

FORMAT: Final = "diagnosis/3"
PARAMETERS = "parameters alone"  # the baseline in the comparison on the held-out runs
Kind = Literal["effect", "partly", "described", "no-gap", "unexplained", "not-finished"]


def _name(file: str) -> str:
    """Name of a run: its file, relative to the evidence folder, without the suffix."""
    return str(PurePath(file).with_suffix(""))


class Estimate(NamedTuple):
    """A fitted number, and the interval that holds the true number with 90 % probability."""

    value: float
    interval_90: tuple[float, float]


class Candidate(NamedTuple):
    """One explanation: an effect of the library, or `none`."""

    effect: str
    probability: float  # NaN where the work ended before any cause was tried
    form: str = ""  # the formula of the effect that fitted best
    parameters: dict[str, Estimate] = {}  # names carry their units
    chi2: float | None = None  # of the fit with this effect alone, with the priors of the nuisances; None: not refitted
    JSON_OPTIONAL = "form", "parameters"


class Cell(NamedTuple):
    """Share of the gap in one signal, regime, band and run; the shares of all cells add up to 1."""

    signal: str
    regime: str  # stick, breakaway, slip, restick, steady
    band_Hz: tuple[float, float]
    file: str  # data file of the run
    share: float  # share of the gap
    JSON_HIDDEN = ("file",)

    @in_json
    def run(self) -> str:
        """Name of the run: its file without the suffix."""
        return _name(self.file)


class Shrinkage(NamedTuple):
    """Share of the gap on held-out runs that one explanation closes: (retuned - gap) / (retuned - floor).

    `retuned` is the gap of the baseline.
    """

    who: str  # the effect or effects, PARAMETERS
    gap: float
    shrinkage: float | None  # None: there was no gap to close
    interval_90: tuple[float, float] | None


class Gap(NamedTuple):
    """The gap on held-out runs, in noise floors; 1.0 is a perfect model."""

    definition: str
    files: tuple[str, ...] = ()  # data files of the held-out runs
    nominal: float = math.nan  # gap of the rig as described
    retuned: float = math.nan  # gap of the baseline
    with_effect: float = math.nan
    floor: float = 1.0
    shrinkage: float | None = None
    interval_90: tuple[float, float] | None = None
    compared: tuple[Shrinkage, ...] = ()  # best explanation, runner-up, parameters alone
    JSON_HIDDEN = ("files",)

    @in_json
    def runs(self) -> tuple[str, ...]:
        """The held-out runs, each by the name of its file without the suffix."""
        return tuple(map(_name, self.files))


class RigNumber(NamedTuple):
    """A number of the rig table: the described value, and the value refitted within its tolerance."""

    name: str
    described: float
    retuned: float  # in the baseline
    tolerance: float  # one standard deviation, relative, or absolute where 0 is described; 0: known exactly


class WrongNumber(NamedTuple):
    """A described number of the rig that the fitted runs contradict."""

    name: str
    described: float
    found: float
    interval_90: tuple[float, float]
    off: float | None  # distance from the described number, in tolerances; None: it was described as known exactly
    # share of the gap on the held-out runs that it closes if all else is corrected; None: no gap without it
    share: float | None


class Experiment(NamedTuple):
    """The experiment to do next."""

    what: str
    why: str
    gain: float | None  # distance of the leading candidates after the experiment, in standard deviations


class Curve(NamedTuple):
    """A line or a point cloud of a picture."""

    label: str
    x: Floats
    y: Floats
    style: Literal["measured", "nominal", "retuned", "effect", "points"]


class Picture(NamedTuple):
    """One picture of the report. `kind`: cycle: measured over predicted; residual: over the variable that explains it."""

    kind: Literal["cycle", "residual"]
    title: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]


class Share(NamedTuple):
    """Share of a relation's residual on the held-out runs; 1 is the mean square that the baseline leaves."""

    signal: str  # spring relation, motion relation, drive relation, exciter, base
    what: str  # a cause, "noise" or "unexplained"
    share: float
    interval_90: tuple[float, float] | None  # None for noise
    # share that noise alone, without the cause, stays below in 9 of 10 draws; None for noise and unexplained
    null_90: float | None

    @property
    def beyond_chance(self) -> bool:
        """Whether the whole interval lies above the share that chance reaches."""
        return self.interval_90 is not None and self.null_90 is not None and self.interval_90[0] > self.null_90


class Remainder(NamedTuple):
    """The largest residual that no known cause explains."""

    share: float | None  # share of the relation's residual on the held-out runs; None without such runs
    where: str  # the relation
    what: str  # the variable that it depends on, or "in bursts"; empty without a pattern
    size: float  # rms of the residual
    noise: float  # rms of its noise
    unit: str


class RelationRow(NamedTuple):
    """One relation between channels, on the fitted runs; sizes are rms in `unit`."""

    relation: str
    unit: str
    described: float  # residual of the rig as described
    refitted: float  # residual of the rig without effects, refitted
    left: float  # residual with the causes of the relation
    noise: float
    causes: tuple[str, ...]


class LedgerRow(NamedTuple):
    """One witness about one explanation."""

    causes: tuple[str, ...]  # none, one or two effects; for friction a cause that may be outside the library
    place: str  # the relation or the signal; `features` for fits
    source: Literal["relation", "friction", "fit", "simulation", "kept runs"]  # simulation: the linear model of the rig
    evidence: float  # natural logarithm, against no effect; NaN where the witness has only a share
    share: float | None = None  # of the difference on the held-out runs that the cause predicts
    interval_90: tuple[float, float] | None = None
    null_90: float | None = None  # share that chance alone reaches in 1 of 10
    agrees: bool | None = None  # whether the size is the same in all runs
    left: float | None = (
        None  # of fits and kept runs: logarithm of the remainder over the remainder of a right explanation
    )


class LeftOut(NamedTuple):
    """A relation that cannot be computed from the channels, and the reason."""

    relation: str
    why: str


class Diagnosis(NamedTuple):
    """The whole answer of a diagnosis."""

    verdict: Kind
    effects: tuple[str, ...]
    summary: tuple[str, ...]  # the answer in six lines
    candidates: tuple[Candidate, ...]  # most probable first; every effect of the library and none; they add up to 1
    complete: float  # probability that nothing else acts; NaN: not judged
    not_distinguishable: tuple[tuple[str, ...], ...]
    where: tuple[Cell, ...]  # largest share first
    gap: Gap
    next_experiment: Experiment
    rig: tuple[RigNumber, ...]
    findings: tuple[Finding, ...]
    pictures: tuple[Picture, ...]
    compared_features: int  # number of compared features of the fitted runs, over which every chi2 is a sum
    elapsed_s: float
    shares: tuple[Share, ...] = ()
    remainder: Remainder | None = None
    relations: tuple[RelationRow, ...] = ()
    left_out: tuple[LeftOut, ...] = ()
    numbers: tuple[WrongNumber, ...] = ()
    ledger: tuple[LedgerRow, ...] = ()
    cannot_show: tuple[str, ...] = ()  # effects excluded by the drive, the runs or assumed numbers
    JSON_HIDDEN = ("pictures",)

    @in_json
    def format(self) -> Literal["diagnosis/3"]:
        """Name and version of the JSON format."""
        return FORMAT
