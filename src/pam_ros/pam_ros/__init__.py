"""What is ROS and belongs to no node: parameters, periodic loop, diagnostics, spinning."""
