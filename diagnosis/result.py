"""The answer of a diagnosis, and its JSON form (`diagnosis/2`, a fixed contract)."""

from pathlib import PurePath
from typing import Any, Literal, NamedTuple

from bridge.arrays import Floats
from bridge.log.finding import Finding

FORMAT = "diagnosis/2"
PARAMETERS = "parameters alone"  # the baseline in the comparison on the held-out runs


class Estimate(NamedTuple):
    """A fitted number, and the interval that holds the true number with 90 % probability."""

    value: float
    interval_90: tuple[float, float]


class Candidate(NamedTuple):
    """One explanation: an effect of the library, `none` or `unexplained`."""

    effect: str
    probability: float
    form: str = ""  # the formula of the effect that fitted best
    parameters: dict[str, Estimate] = {}  # names carry their units
    chi2: float | None = None  # of the fit with this effect alone, with the priors of the nuisances; None: not refitted


class Cell(NamedTuple):
    """One place where the gap lies; the shares of all cells add up to 1."""

    signal: str
    regime: str  # stick, breakaway, slip, restick, steady
    band_Hz: tuple[float, float]
    run: str
    share: float


class Shrinkage(NamedTuple):
    """Share of the gap on held-out runs that one explanation closes: (retuned - gap) / (retuned - floor).

    `retuned` is the gap of the baseline.
    """

    who: str  # the effect or effects, PARAMETERS, "flexible residual"
    gap: float
    shrinkage: float | None  # None: there was no gap to close
    interval_90: tuple[float, float] | None


class Gap(NamedTuple):
    """The gap on held-out runs, in noise floors; 1.0 is a perfect model."""

    definition: str
    runs: tuple[str, ...]  # files of the held-out runs
    nominal: float  # of the rig as described
    retuned: float  # of the baseline
    with_effect: float
    floor: float
    shrinkage: float | None
    interval_90: tuple[float, float] | None
    compared: tuple[Shrinkage, ...]  # best effect, runner-up, parameters alone, flexible residual
    refuted: tuple[str, ...] = ()  # effects that the fitted runs show and the held-out runs do not confirm


class RigNumber(NamedTuple):
    """A number of the rig table: as described, and refitted within its tolerance."""

    name: str
    described: float
    retuned: float  # in the baseline
    tolerance: float  # one standard deviation, relative, or absolute where 0 is described; 0: known exactly


class Experiment(NamedTuple):
    """The experiment to do next."""

    what: str
    why: str
    gain: float | None  # distance of the leading candidates after it, in standard deviations


class Curve(NamedTuple):
    """A line or a cloud of a picture."""

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
    """Share of a relation's residual on the held-out runs: the mean square that the baseline leaves there is 1."""

    signal: str  # spring relation, motion relation, drive relation, exciter, base
    what: str  # a cause, "noise" or "unexplained"
    share: float
    interval_90: tuple[float, float] | None  # None for noise
    null_90: (
        float | None
    )  # share that the same noise without that cause stays below in 9 of 10 draws; None for noise and unexplained

    @property
    def beyond_chance(self) -> bool:
        """Whether the whole interval lies above the share that chance reaches."""
        return self.interval_90 is not None and self.null_90 is not None and self.interval_90[0] > self.null_90


class Remainder(NamedTuple):
    """The largest residual that no known cause explains."""

    share: float | None  # of that relation on the held-out runs; None without such runs
    where: str  # the relation
    what: str  # the variable that it depends on, or "in bursts"; empty without a pattern
    size: float  # rms
    noise: float  # rms
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


class LeftOut(NamedTuple):
    """A relation that the channels do not allow."""

    relation: str
    why: str


class RelationNumber(NamedTuple):
    """A number of the rig table as one relation alone shows it."""

    name: str
    relation: str
    described: float
    refitted: float
    interval_90: tuple[float, float]


class Diagnosis(NamedTuple):
    """The whole answer of a diagnosis."""

    verdict: Literal["effect", "partly", "no-gap", "unexplained"]
    effects: tuple[str, ...]
    summary: tuple[str, ...]  # the answer in plain words, the first sentence first
    candidates: tuple[Candidate, ...]  # most probable first; every effect of the library, none and unexplained
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
    numbers: tuple[RelationNumber, ...] = ()
    cannot_show: tuple[str, ...] = ()  # effects that this kind of drive, or these runs, cannot show


def _name(run: str) -> str:
    """The file of a run, relative to the evidence folder, without its suffix."""
    return str(PurePath(run).with_suffix(""))


def to_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """The JSON object of the contract `diagnosis/2`; the pictures are left out.

    A run goes by the name of its file without the suffix.
    """
    return {
        "format": FORMAT,
        "verdict": diagnosis.verdict,
        "effects": list(diagnosis.effects),
        "summary": list(diagnosis.summary),
        "candidates": [_candidate(candidate) for candidate in diagnosis.candidates],
        "not_distinguishable": [list(group) for group in diagnosis.not_distinguishable],
        "where": [
            {**cell._asdict(), "band_Hz": list(cell.band_Hz), "run": _name(cell.run)} for cell in diagnosis.where
        ],
        "gap": {
            **diagnosis.gap._asdict(),
            "runs": [_name(run) for run in diagnosis.gap.runs],
            "interval_90": _listed(diagnosis.gap.interval_90),
            "compared": [{**row._asdict(), "interval_90": _listed(row.interval_90)} for row in diagnosis.gap.compared],
        },
        "next_experiment": diagnosis.next_experiment._asdict(),
        "rig": [parameter._asdict() for parameter in diagnosis.rig],
        "findings": [finding._asdict() for finding in diagnosis.findings],
        "compared_features": diagnosis.compared_features,
        "elapsed_s": round(diagnosis.elapsed_s, 2),
        "shares": [{**share._asdict(), "interval_90": _listed(share.interval_90)} for share in diagnosis.shares],
        "remainder": None if diagnosis.remainder is None else diagnosis.remainder._asdict(),
        "relations": [{**relation._asdict(), "causes": list(relation.causes)} for relation in diagnosis.relations],
        "left_out": [omitted._asdict() for omitted in diagnosis.left_out],
        "cannot_show": list(diagnosis.cannot_show),
        "numbers": [{**number._asdict(), "interval_90": list(number.interval_90)} for number in diagnosis.numbers],
    }


def _candidate(candidate: Candidate) -> dict[str, Any]:
    result: dict[str, Any] = {
        "effect": candidate.effect,
        "probability": candidate.probability,
        "chi2": None if candidate.chi2 is None else round(candidate.chi2, 2),
    }
    if candidate.form:
        result["form"] = candidate.form
    if candidate.parameters:
        result["parameters"] = {
            name: {"value": estimate.value, "interval_90": list(estimate.interval_90)}
            for name, estimate in candidate.parameters.items()
        }
    return result


def _listed(interval: tuple[float, float] | None) -> list[float] | None:
    return None if interval is None else list(interval)
