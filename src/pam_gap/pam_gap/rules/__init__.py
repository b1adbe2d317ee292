"""Every hand-set constant of the diagnosis that can change its answer, in one table.

`DEFAULT` holds the values in use. A `Rules` object with other values can be handed to a diagnosis;
`table()` lists all of them with what they decide, what they trade and where they came from.
"""

from pam_gap.rules.table import DEFAULT, RuleEntry, Rules, changed, table

__all__ = ["DEFAULT", "RuleEntry", "Rules", "changed", "table"]
