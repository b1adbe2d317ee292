"""Two muscles about a pulley: torque, stiffness, and the pressures that give both."""
