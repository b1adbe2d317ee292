"""The control laws: which pressures a joint should have. One file per law."""
