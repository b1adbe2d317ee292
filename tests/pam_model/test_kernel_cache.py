"""Where machine code of the plant is kept."""

import os
from pathlib import Path

from pam_model.plant import compiled


def test_a_read_only_installation_keeps_machine_code_in_the_users_cache(
    tmp_path: Path, monkeypatch
) -> None:
    installed = tmp_path / "installed"
    installed.write_text("no folder can be made in it")
    monkeypatch.setattr(compiled, "_HERE", installed)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = Path(compiled._cache_folder())
    assert folder.parent == tmp_path / "cache" / "pam_model"
    assert os.access(folder, os.W_OK)


def test_without_any_folder_nothing_is_kept(tmp_path: Path, monkeypatch) -> None:
    installed = tmp_path / "installed"
    installed.write_text("")
    monkeypatch.setattr(compiled, "_HERE", installed)
    monkeypatch.setenv("XDG_CACHE_HOME", str(installed))
    assert compiled._cache_folder() == ""
