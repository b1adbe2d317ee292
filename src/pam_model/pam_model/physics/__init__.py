"""Laws that several packages share, as functions of floats; the plant compiles them."""
