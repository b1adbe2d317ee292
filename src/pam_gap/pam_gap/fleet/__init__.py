"""Many recordings over weeks: diagnosed in parallel, tracked, and searched for changes."""
