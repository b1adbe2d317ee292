"""The comparison in docs/models.md is what the command writes."""

from pathlib import Path
from shutil import copytree

import pytest

from pam_check.__main__ import main
from pam_check.doc_pages.comparison_tables import rows_of
from pam_model.__main__ import main as pam_model
from pam_model.identify.compare import compare
from pam_model.identify.measurements import load_measurements

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "models.md"
DATA = ROOT / "tests" / "data" / "festo_platform" / "PtoD_40.csv"
QUICK = ("gaylord", "tondu_lopez", "sarosi", "wickramatunge")
"""Models that take seconds; the others come from the same command in the same run."""


def printed() -> list[dict[str, list[str]]]:
    text = PAGE.read_text(encoding="utf-8")
    section = text[text.index("comparison: begin") : text.index("comparison: end")]
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
    assert pam_model(["compare", str(DATA), "--models", "gaylord", "--json"]) == 0
    ranking = tmp_path / "ranking.json"
    ranking.write_text(capsys.readouterr().out, encoding="utf-8")
    for folder in ("docs", "config"):
        copytree(ROOT / folder, tmp_path / folder, ignore=lambda _, names: {"gallery", "images"})
    page = tmp_path / "docs/models.md"
    assert main(["pages", str(tmp_path), "--comparison", str(ranking)]) == 0
    made = page.read_text(encoding="utf-8")
    assert made.count("| `gaylord` | 3 |") == 2
    assert "`shen_shi` | 7" not in made
    assert main(["pages", str(tmp_path)]) == 0
    assert page.read_text(encoding="utf-8") == made, "without a comparison it stays as it is"
    ranking.write_text("[{}]", encoding="utf-8")
    assert main(["pages", str(tmp_path), "--comparison", str(ranking)]) == 2
    assert "ranking.json: not what `pam model compare --json` prints" in capsys.readouterr().err
