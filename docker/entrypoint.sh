#!/usr/bin/env bash
# Sources ROS 2 and the workspace, then runs the command.
set -e
source /opt/ros/jazzy/setup.bash
source /workspace/install/setup.bash
exec "$@"
