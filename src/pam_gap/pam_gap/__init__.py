"""Diagnosis of the gap between a recording of a real rig and its simulation.

The public names, without ROS:

- `import_recording`, `Recording`, `RecordingError`: read a rosbag2, CSV or Parquet recording.
- `diagnose`, `Diagnosis`: find the cause of the gap from recordings and a rig; nothing is written.
- `diagnose_files`: the same from files; writes report, diagnosis.json and improved rig file.

The names are imported when they are first used, so that importing the package takes no time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pam_gap.answer.diagnosis import Diagnosis
    from pam_gap.diagnose_recordings import diagnose
    from pam_gap.diagnosis_files import diagnose_files
    from pam_gap.recordings.import_recording import import_recording
    from pam_gap.recordings.recording import Recording, RecordingError

__all__ = [
    "Diagnosis",
    "Recording",
    "RecordingError",
    "diagnose",
    "diagnose_files",
    "import_recording",
]


def __getattr__(name: str) -> Any:
    """Import a public name."""
    match name:
        case "__version__":
            from pam_ros.version import installed_version

            return installed_version(__name__)
        case "Diagnosis":
            from pam_gap.answer import diagnosis

            return getattr(diagnosis, name)
        case "diagnose_files":
            from pam_gap import diagnosis_files

            return getattr(diagnosis_files, name)
        case "diagnose":
            from pam_gap import diagnose_recordings

            return getattr(diagnose_recordings, name)
        case "import_recording":
            from pam_gap.recordings import import_recording

            return getattr(import_recording, name)
        case "Recording" | "RecordingError":
            from pam_gap.recordings import recording

            return getattr(recording, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """All names, including those that were not imported yet."""
    return sorted({*globals(), *__all__})
