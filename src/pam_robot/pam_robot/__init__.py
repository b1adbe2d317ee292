"""Driver, controller and model of one robot in one process and one cycle."""
