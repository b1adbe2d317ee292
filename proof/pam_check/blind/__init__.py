"""The blind check: rigs with hidden effects are drawn, sealed, diagnosed and scored."""
