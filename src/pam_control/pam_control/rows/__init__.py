"""Places of numbers in the rows that the compiled control cycle works with."""
