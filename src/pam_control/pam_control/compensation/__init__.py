"""Known effects undone: torque, valve and sensor corrections from the rig file."""
