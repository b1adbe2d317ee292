"""An exhaustive walk over the states of driver, board and controller."""
