"""The picture of stiffness and feed: its formulas computed by hand, and the panels of the runs."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from bench.control.axes_map import Noise, draw, needed_window_s, points, reduce_colours, stick_s, window_s
from bench.control.figures import Figures, refused
from tests.bank import BANK

NAMED = {entry.name: entry for entry in BANK}


def run(name: str, **values: object) -> Figures:
    scenario = NAMED[name]
    made = refused(scenario, "controller", "nothing")._replace(failures=[], expect=scenario.bank.expect)
    return made._replace(**values)  # pyright: ignore[reportArgumentType]


def test_the_window_that_a_noise_needs() -> None:
    # 1728 (0.5 um)^2 / (20 kHz (0.5 mm/s)^2) = 8.64e-8 s^3
    assert needed_window_s(5e-7, 5e-4) == pytest.approx(4.42e-3, rel=1e-3)
    # the variance of a slope over that time, by least squares over its samples, is (v_d / 12)^2
    t_s = np.arange(round(4.42e-3 * 2e4)) / 2e4
    assert np.sqrt((5e-7) ** 2 / np.sum((t_s - t_s.mean()) ** 2)) == pytest.approx(5e-4 / 12.0, rel=0.03)
    assert window_s(5e-7, 5e-4) == pytest.approx(np.sqrt(2.0) * 4.42e-3, rel=1e-3)
    assert window_s(1e-9, 5e-4) == 4e-4
    assert np.isinf(window_s(5e-7, 1e-7))


def test_both_sensors_count_by_their_noise() -> None:
    assert Noise(5e-7, 0.01).sigma_m(2e4) == pytest.approx(5e-7 / np.sqrt(2.0))  # 1 % of the drop over k_d is 0.5 um
    assert Noise(5e-7, 0.01).sigma_m(1e6) == pytest.approx(1e-8, rel=1e-3)


def test_a_stick_winds_up_twice_the_drop() -> None:
    assert stick_s(11700.0 / 2.89, 5e-4) == pytest.approx(2.0 * 2.89 / 11700.0 / 5e-4)


def test_each_run_is_drawn_in_the_panel_of_its_noise() -> None:
    came = {"slips": 1}
    drawn_points = points(
        BANK,
        [
            run("pair-c45-0.5"),
            run("noise-both", **came),
            run("blind-screw", words={"BLIND": 0.01}),
            run("no-drop-stiff"),  # never sticks: no point
        ],
    )
    assert [(point.name, point.panel, point.outcome) for point in drawn_points] == [
        ("pair-c45-0.5", 0, "clean"),
        ("noise-both", 1, "slips or surges"),
        ("blind-screw", 2, "reports BLIND"),
    ]
    assert drawn_points[0].slowest_mps == drawn_points[0].fastest_mps == 5e-4
    assert drawn_points[0].stiffness_per_m == pytest.approx(11700.0 / 2.89, rel=2e-3)


@pytest.mark.slow
def test_it_is_a_picture(tmp_path: Path) -> None:
    path = tmp_path / "axes.svg"
    draw(BANK, [run("step-stiff", surges=1), run("pair-c45-0.5"), run("pair-c45-1")], path)
    assert "<dc:title>for which axes it works" in path.read_text()


def test_fewer_colours_keep_a_pictures_texts_and_resolution(tmp_path: Path) -> None:
    texts = PngInfo()
    texts.add_text("Title", "which axes")
    shades = Image.fromarray(np.random.default_rng(1).integers(0, 256, (80, 80, 4), np.uint8))
    shades.save(tmp_path / "a.png", dpi=(110, 110), pnginfo=texts)
    reduce_colours(tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        assert image.mode == "P"
        assert len(image.getcolors() or ()) <= 64
        assert (image.size, image.info["Title"], round(image.info["dpi"][0])) == ((80, 80), "which axes", 110)
