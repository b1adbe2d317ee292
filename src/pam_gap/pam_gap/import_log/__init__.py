"""Any log: which column is which channel, a proposal of it, and a page of what was understood."""
