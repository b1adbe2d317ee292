"""The tables of effects in the docs agree with the registry."""

from __future__ import annotations

from pathlib import Path
from shutil import copy

import pytest

from pam_check.doc_pages.effects_page import page_text
from pam_model.__main__ import main
from pam_model.effect_tables import PAGES, table, with_tables, write_tables
from pam_model.effects import EFFECTS
from pam_model.errors import PamError

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_up_to_date(name: str) -> None:
    page = (DOCS / name).read_text(encoding="utf-8")
    assert with_tables(page) == page, "run `pam model effect-tables`"


def test_the_page_of_effects_is_up_to_date() -> None:
    page = (DOCS / "effects.md").read_text(encoding="utf-8")
    assert page == page_text(), "run `pam check effects`"


def test_every_effect_stands_in_one_table_of_keys() -> None:
    keys = "".join(table(scope) for scope in ("muscle", "joint", "rig"))
    assert [name for name in EFFECTS if keys.count(f"\n| `{name}` | ") != 1] == []
    for kind in ("control", "plausibility"):
        assert all(f"| `{name}` | " in table(kind) for name in EFFECTS)


def test_an_old_table_is_written_anew(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in PAGES:
        copy(DOCS / name, tmp_path)
    page = tmp_path / "rig_file.md"
    true = page.read_text(encoding="utf-8")
    page.write_text(true.replace("C_l", "C_x"), encoding="utf-8")
    assert page.read_text(encoding="utf-8") != true
    assert main(["effect-tables", str(tmp_path)]) == 0
    assert str(page) in capsys.readouterr().out
    assert page.read_text(encoding="utf-8") == true
    assert write_tables(tmp_path) == []


def test_a_page_without_a_place_is_told(tmp_path: Path) -> None:
    with pytest.raises(PamError, match="no such page"):
        write_tables(tmp_path)
    for name in PAGES:
        (tmp_path / name).write_text("# A page\n")
    with pytest.raises(PamError, match="contains no table of effects"):
        write_tables(tmp_path)
    with pytest.raises(PamError, match="unknown table of effects 'colours'"):
        with_tables("<!-- effects: colours -->\n<!-- end of effects -->")
