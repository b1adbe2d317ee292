"""Diagnosis of the gap between a recording of a real rig and its simulation.

The public names, without ROS:

- `import_recording`, `Recording`, `RecordingError`: read a rosbag2, CSV or Parquet recording.
- `diagnose`, `Diagnosis`: find the cause of the gap from recordings and a rig; nothing is written.
- `diagnose_files`: the same from files; writes report, diagnosis.json and improved rig file.

The names are imported when they are first used, so that importing the package takes no time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pam_ros.lazy_names import lazy_names

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

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "answer.diagnosis": "Diagnosis",
        "diagnose_recordings": "diagnose",
        "diagnosis_files": "diagnose_files",
        "recordings.import_recording": "import_recording",
        "recordings.recording": "Recording RecordingError",
    },
)
