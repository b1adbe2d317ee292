"""What the documentation shows of the code is what the code says."""

from __future__ import annotations

from pathlib import Path
from shutil import copytree

import numpy as np
import pytest

from pam_check.__main__ import main
from pam_check.doc_pages.effect_tables import control_table, keys_table
from pam_check.doc_pages.markdown import places, table, updated
from pam_check.doc_pages.models_table import draw_row
from pam_check.doc_pages.pages import PARTS, texts
from pam_gap.rules import table as constants
from pam_model.catalogue.catalogue import CatalogueRow, catalogue
from pam_model.effects import EFFECTS
from pam_model.errors import PamError

ROOT = Path(__file__).parents[2]
MADE = texts(ROOT)


@pytest.mark.parametrize("path", MADE, ids=lambda path: path.name)
def test_a_page_is_up_to_date(path: Path) -> None:
    assert path.read_text(encoding="utf-8") == MADE[path], "run `./pam check pages`"


def test_every_table_stands_in_a_page() -> None:
    shown = {name for text in MADE.values() for name in places(text)}
    assert shown == {*PARTS, "comparison"}


def test_every_effect_stands_in_one_table_of_keys() -> None:
    keys = "".join(keys_table(scope) for scope in ("muscle", "joint", "rig"))
    assert [name for name in EFFECTS if keys.count(f"\n| `{name}` | ") != 1] == []
    assert all(f"| `{name}` | " in control_table() for name in EFFECTS)


def test_every_constant_stands_in_its_page() -> None:
    page = MADE[ROOT / "docs/constants_of_the_diagnosis.md"]
    assert [c.path for c in constants() if f"| `{c.path}` | {c.value:g} |" not in page] == []


def test_an_old_table_is_written_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    copytree(ROOT / "docs", tmp_path / "docs", ignore=lambda _, names: {"gallery", "images"})
    copytree(ROOT / "config", tmp_path / "config")
    page = tmp_path / "docs/rig_file.md"
    true = page.read_text(encoding="utf-8")
    page.write_text(true.replace("C_l", "C_x"), encoding="utf-8")
    assert page.read_text(encoding="utf-8") != true
    assert main(["pages", str(tmp_path)]) == 0
    assert capsys.readouterr().out == f"written: {page}\n"
    assert page.read_text(encoding="utf-8") == true
    assert main(["pages", str(tmp_path)]) == 0
    assert capsys.readouterr().out == "all is up to date\n"


def test_what_cannot_be_written_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["pages", str(tmp_path)]) == 2
    assert "has no folder docs" in capsys.readouterr().err
    with pytest.raises(PamError, match="nothing is called 'colours'; expected one of diagram"):
        updated("<!-- colours: begin -->\n<!-- colours: end -->", PARTS)


def test_a_bar_in_a_cell_is_no_border() -> None:
    assert table(("a",), [("|x|",)]) == "| a |\n|---|\n| \\|x\\| |"


@pytest.mark.parametrize("row", catalogue(), ids=lambda row: row.key)
def test_each_model_has_a_picture_with_something_on_it(row: CatalogueRow) -> None:
    for axis in draw_row(row).axes:
        drawn = [np.asarray(line.get_ydata(), dtype=float) for line in axis.get_lines()]
        assert any(np.count_nonzero(np.isfinite(y)) > 1 for y in drawn)
