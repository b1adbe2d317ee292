"""Length-force models of muscles: one file each in `models`, and what they share.

Importing this package fills the register of force models (`force_model.registered_models`).
"""

import pam_model.muscles.models  # noqa: F401
