"""Length-force models of muscles, with one file per model in `models`, and their shared parts.

Importing this package fills the register of force models (`force_model.registered_models`).
"""

import pam_model.muscles.models  # noqa: F401
