"""The other models of the review: bending, losses, phenomenological models, air supply."""
