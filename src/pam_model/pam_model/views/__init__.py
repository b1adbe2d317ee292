"""Views: what safety, checks, control and export ask of a robot, as pure functions.

Each file answers one question. A view takes a `Robot` (or one of its joints or muscles), in which
the effects of the rig file are applied, and keeps no state. No other package has formulas of a
joint or a muscle of its own.

Where a view says nothing else, `pressures` are gauge [Pa], one for each muscle of the robot, and
`positions` are angles [rad], one for each joint.
"""
