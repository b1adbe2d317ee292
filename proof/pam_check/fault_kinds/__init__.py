"""The kinds of fault as data: what happens, who detects it, what must follow, and how soon."""
