"""The withheld check: rigs with hidden effects, drawn, sealed, diagnosed and scored."""
