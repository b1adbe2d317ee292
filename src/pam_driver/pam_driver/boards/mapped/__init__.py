"""The kind `mapped`: any device that a DBC file describes, mapped by the rig file."""
