"""What the controller learns of its rig while it moves: torques of joints, flows of valves."""
