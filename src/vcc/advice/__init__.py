"""A camera and a plan in words: what was folded and chosen, what samples hold, what a picture lacks and costs."""
