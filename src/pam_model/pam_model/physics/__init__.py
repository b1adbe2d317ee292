"""Laws that several packages share: functions of floats, which the plant can compile."""
