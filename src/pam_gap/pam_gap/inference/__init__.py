"""Which effects explain a gap: candidates, search, selection, confidence, verdict."""
