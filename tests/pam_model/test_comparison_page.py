"""The comparison in docs/models.md is what the command writes."""

from pathlib import Path

import pytest

from pam_model.__main__ import main
from pam_model.errors import PamError
from pam_model.identify.compare import compare
from pam_model.identify.comparison_page import BEGIN, END, rows_of, write_comparison
from pam_model.identify.measurements import load_measurements

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "models.md"
DATA = ROOT / "tests" / "data" / "festo_platform" / "PtoD_40.csv"
QUICK = ("gaylord", "tondu_lopez", "sarosi", "wickramatunge")
"""Models that take seconds; the others come from the same command in the same run."""


def printed() -> list[dict[str, list[str]]]:
    text = PAGE.read_text(encoding="utf-8")
    section = text[text.index(BEGIN) : text.index(END)]
    tables: list[dict[str, list[str]]] = []
    for line in section.splitlines():
        if line.startswith("| model"):
            tables.append({})
        elif line.startswith("| `"):
            name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
            tables[-1][name.strip("`")] = cells
    return tables


@pytest.mark.sampled(
    "one of the four models; fits of each are held in test_fit_and_compare", cases=1
)
@pytest.mark.parametrize("quick", QUICK)
def test_figures_of_the_page_are_those_of_the_command(quick: str) -> None:
    tables = printed()
    made = compare(load_measurements(DATA), [quick], fit_geometry=True, residual="length")
    assert len(tables) == len(made) == 2
    for table, comparison in zip(tables, made, strict=True):
        for model, cells in rows_of(comparison.as_dict()).items():
            assert table[model][0] == cells[0], model
            for shown, now in zip(table[model][1:3], cells[1:3], strict=True):
                # the last printed digit may be rounded either way
                assert float(shown) == pytest.approx(float(now), rel=3e-3), model


def test_page_gets_a_table_for_each_branch(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n", encoding="utf-8")
    made = compare(load_measurements(DATA), ["gaylord"], fit_geometry=True, residual="length")
    write_comparison([c.as_dict() for c in made], page)
    text = page.read_text(encoding="utf-8")
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "old" not in text
    assert text.count("| `gaylord` | 3 |") == 2
    page.write_text("no markers\n", encoding="utf-8")
    with pytest.raises(PamError, match="has no lines"):
        write_comparison([], page)
    assert main(["compare", str(DATA), "--models", "gaylord", "--page", str(page)]) == 2
    assert "has no lines" in capsys.readouterr().err
