"""The kind `canopen`: devices after CiA 301 and its device profiles, described by an EDS file."""
