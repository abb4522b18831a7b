"""`Workshop`: draws effects, and writes evidence as its owner would."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from plant.effects.library import EFFECTS
from tests.blind.generators import Plan
from tests.blind.workshop.campaigns import Run, draw_campaign
from tests.blind.workshop.measure import measure
from tests.blind.workshop.outside import ACTORS, OUTSIDE, hysteresis_N
from tests.blind.workshop.rigs import LAWS, Rig, draw_rig
from tests.blind.workshop.sizes import SIZES, Drawn, drawn

_RIG, _CAMPAIGN = 1, 2  # streams of a seed; run n has stream 10 + n


class Workshop:
    """A source of rigs; see `tests.blind.generators.Generator`."""

    library: tuple[str, ...] = tuple(SIZES)
    outside: tuple[str, ...] = tuple(OUTSIDE)
    usual: str | None = LAWS[0]
    backbones: tuple[str, ...] = LAWS[1:]
    strongest: float = 1.0
    wide: float = 1.3  # numbers are drawn up to 2.5 tolerances, so up to 3.25

    def draw(self, random: np.random.Generator, name: str) -> Drawn:
        """An effect at full strength."""
        if name in OUTSIDE:
            return drawn(random, name, "", OUTSIDE[name])
        form, sizes = SIZES[name][random.integers(len(SIZES[name]))]
        return drawn(random, name, form, sizes)

    def formula(self, effect: Drawn) -> str:
        """Formula and numbers; a unit in brackets is a key of `Rig.units`."""
        if effect.name in SIZES:
            formula = EFFECTS[effect.name].forms[effect.form].formula
        else:
            formula = str(ACTORS.get(effect.name, hysteresis_N).__doc__)
        units = {number.name: f" [{number.unit}]" if number.unit else "" for number in effect.numbers}
        numbers = effect.scaled(max(effect.strength, 1e-9)).values(dict.fromkeys((n.unit for n in effect.numbers), 1.0))
        return f"{formula}; {', '.join(f'{name} = {value:.4g}{units[name]}' for name, value in numbers.items())}"

    def true_numbers(self, plan: Plan, seed: int) -> dict[str, float]:
        """The numbers of the rig, by key of the manifest."""
        return self.bench(plan, seed)[0].true

    def make(self, folder: Path, plan: Plan, seed: int) -> None:
        """Evidence; the same plan and seed give the same bytes, and without its effects the same rig without them."""
        rig, campaign = self.bench(plan, seed)
        folder.mkdir(parents=True, exist_ok=True)
        left_out = {*plan.leave_out, *rig.lacks}
        for number, run in enumerate(campaign):
            columns = measure(rig, run, tuple(plan.effects), [seed, 10 + number])
            types = {name: np.float64 if name == "t_s" else np.float32 for name in columns if name not in left_out}
            table = {name: columns[name].astype(type_) for name, type_ in types.items()}
            pq.write_table(pa.table(table), folder / _file(number))
        (folder / "manifest.toml").write_text(_manifest(rig, campaign), encoding="utf-8")

    def bench(self, plan: Plan, seed: int) -> tuple[Rig, tuple[Run, ...]]:
        """The rig of a seed and its runs."""
        if unknown := {*plan.leave_out} & {"t_s", "drive_force_N"}:
            raise ValueError(f"leave_out: {', '.join(sorted(unknown))}: every evidence of this workshop has it")
        if plan.backbone not in (None, *LAWS):
            raise ValueError(f"backbone = {plan.backbone!r}: unknown friction law; known: {', '.join(LAWS)}")
        rig = draw_rig(np.random.default_rng([seed, _RIG]), plan.backbone, plan.tolerances, plan.smooth)
        return rig, draw_campaign(rig.kind, np.random.default_rng([seed, _CAMPAIGN]))


def _file(number: int) -> str:
    return f"run-{number + 1:02d}.parquet"


def _manifest(rig: Rig, campaign: tuple[Run, ...]) -> str:
    lines = ['format = "evidence/1"', "", "[rig]", 'drive = "spring"']
    lines += [f"{name} = {number!r}" for name, number in rig.described.items()]
    lines += ["", "[rig.tolerance]", *(f"{name} = {share!r}" for name, (_, share) in rig.kind.numbers.items())]
    for number, run in enumerate(campaign):
        lines += ["", "[[run]]", f'file = "{_file(number)}"', f"holdout = {str(run.held_out).lower()}"]
        if run.velocity_mps is not None:
            lines += [f"drive_velocity_mps = {run.velocity_mps!r}"]
    return "\n".join(lines) + "\n"
