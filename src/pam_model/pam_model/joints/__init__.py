"""A joint with two muscles on a pulley: torque, stiffness, and the pressures for both."""
