"""The folder of compiled kernels changes with every source that a kernel can hang on."""

import pytest

from bridge.kernel import PACKAGES, sources_digest


@pytest.mark.parametrize("package", PACKAGES)
@pytest.mark.parametrize("place", ["core.py", "effects/friction.py", "effects/rigs/four.py"])
def test_an_edit_in_any_sub_package_changes_the_key(tmp_path, package, place):
    path = tmp_path / package / place
    path.parent.mkdir(parents=True)
    path.write_text("STEP_S = 1e-5\n")
    before = sources_digest(tmp_path)
    path.write_text("STEP_S = 2e-5\n")
    assert sources_digest(tmp_path) != before
