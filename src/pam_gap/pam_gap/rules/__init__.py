"""All hand-set constants that can change the answer of the diagnosis, in one table.

`DEFAULT` holds the values in use. A diagnosis also accepts a `Rules` object with other values.
`table()` lists each constant with its meaning, the effect of a change, and its origin.
"""

from pam_gap.rules.table import DEFAULT, RuleEntry, Rules, changed, table

__all__ = ["DEFAULT", "RuleEntry", "Rules", "changed", "table"]
