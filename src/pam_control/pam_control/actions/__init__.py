"""The action FollowJointTrajectory: tolerances, the watch over a goal, and the action server."""
